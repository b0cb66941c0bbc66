"""What a user reads in one line, instead of a traceback."""


class Failure(Exception):
    pass
