"""What a user is told in one line, instead of a traceback."""


class Failure(Exception):
    pass
