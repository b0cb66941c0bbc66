"""compare_page.py PICTURES REFS OUT.html: photonmill's pictures beside Cycles' references, as one page.

PICTURES holds NAME.sky.exr, NAME.lamp.exr, NAME.sun.exr, and NAME.own.exr of files under their own light:

    photonmill render NAME.glb      --size 96x96 --error 1% --environment 1    -o PICTURES/NAME.sky.exr
    photonmill render NAME.lamp.glb --size 96x96 --error 1%                    -o PICTURES/NAME.lamp.exr
    photonmill render NAME.sun.glb  --size 96x96 --error 1% --environment 0.05 -o PICTURES/NAME.sun.exr

REFS holds the same names as .npz, of cycles_ref.py. A picture is right if, over the pixels that some object covers,

    means       of each channel differ by less than 3 %
    blocks      of 4 x 4 pixels that touch an object: RMS difference below 8 % of their mean
    highlights  blocks brighter than twice the mean of the covered pixels: RMS difference below 15 % of their mean

Prints the table too; exits with 1 if a picture is wrong or missing. Needs OpenEXR, numpy and pillow (PyPI).
"""

import base64
import glob
import html
import io
import os
import sys

import numpy as np

MEANS, BLOCKS, HIGHLIGHTS = 0.03, 0.08, 0.15
LIGHTS = (".sky", ".lamp", ".sun", ".own")
SHOWN = 288  # pixels of a picture on the page


def block_means(image):
    height, width = image.shape[0] // 4, image.shape[1] // 4
    return image.reshape(height, 4, width, 4, -1).mean((1, 3))


def highlights(image, mask):
    """Blocks that touch an object, and those among them brighter than twice the mean of the covered pixels."""
    blocks = block_means(mask[..., None]).squeeze(-1) > 0
    bright = block_means(image).mean(-1) > 2 * image[mask].mean() if mask.any() else blocks
    return blocks, blocks & bright


def load_exr(path):
    import OpenEXR

    channels = OpenEXR.File(path).channels()
    pixels = channels["RGB"].pixels if "RGB" in channels else np.stack([channels[c].pixels for c in "RGB"], -1)
    return pixels[..., :3].astype(float)


def compare(ours, reference):
    """Ratio of means by channel, relative RMS difference of blocks, the same in highlights (None where there is none), right?"""
    image, mask = reference["image"].astype(float), reference["mask"]
    ratios = ours[mask].mean(0) / np.maximum(image[mask].mean(0), 1e-30)
    blocks, bright = highlights(image, mask)
    means = block_means(image)
    square = ((block_means(ours) - means) ** 2).mean(-1)
    rmse = lambda chosen: np.sqrt(square[chosen].mean()) / means[chosen].mean() if chosen.any() else None
    of_blocks, of_bright = rmse(blocks), rmse(bright)
    right = np.abs(ratios - 1).max() < MEANS and of_blocks < BLOCKS and (of_bright is None or of_bright < HIGHLIGHTS)
    return ratios, of_blocks, of_bright, right


def png(image, exposure):
    """As an HTML image: sRGB of linear values times exposure."""
    from PIL import Image

    linear = np.clip(image * exposure, 0, 1)
    encoded = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    data = io.BytesIO()
    Image.fromarray(np.round(encoded * 255).astype("u1")).save(data, "PNG")
    return f'<img width={SHOWN} src="data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}">'


def number(value, digits=3):
    return f"{value:.{digits}f}" if value else "-"


def main(pictures, references, out):
    rows, shown, wrong = [], [], 0
    names = sorted(os.path.basename(path)[:-4] for path in glob.glob(references + "/*.npz"))
    names = [name for name in names if name.endswith(LIGHTS)]
    names.sort(key=lambda name: (name.rsplit(".", 1)[0], LIGHTS.index(name[name.rindex("."):])))
    for name in names:
        reference = dict(np.load(f"{references}/{name}.npz"))
        image, noise, path = reference["image"].astype(float), reference["noise"], f"{pictures}/{name}.exr"
        problem = None
        if not os.path.exists(path):
            problem = "no picture"
        else:
            ours = load_exr(path)
            if ours.shape != image.shape:
                problem = f"is {ours.shape[1]} x {ours.shape[0]}, wanted {image.shape[1]} x {image.shape[0]}"
            elif not np.isfinite(ours).all():
                problem = f"has {np.size(ours) - np.isfinite(ours).sum()} values that are not finite"
        cells, right = ["-"] * 5, False
        if not problem:
            ratios, of_blocks, of_bright, right = compare(ours, reference)
            cells = [*(f"{ratio:.3f}" for ratio in ratios), number(of_blocks), number(of_bright)]
            # The covered pixels' 90th percentile becomes white, but the sky keeps its own brightness.
            exposure = 1 if name.endswith(".sky") else 1 / max(np.quantile(image[reference["mask"]], 0.9), 1e-9)
            caption = f"{html.escape(name)}: ours | Cycles | difference x 4"
            three = "".join(png(picture, exposure) for picture in (ours, image, 4 * np.abs(ours - image)))
            shown.append(f"<h2 id={name}>{caption} <small>{'right' if right else 'WRONG'}</small></h2>{three}")
        wrong += not right
        cells = [name, *cells, number(noise[1]), number(noise[2]), "right" if right else problem or "WRONG"]
        rows.append(cells)
        print(f"{cells[0]:34s}" + " ".join(f"{cell:>7s}" for cell in cells[1:]), flush=True)
    header = ["picture", "red", "green", "blue", "blocks", "highlights", "noise of reference's blocks", "in highlights", ""]
    line = lambda tag, cells: "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"
    linked = lambda cells: line("td", cells).replace(f"<td>{cells[0]}</td>", f"<td><a href=#{cells[0]}>{cells[0]}</a></td>", 1)
    title = f"{len(names) - wrong} of {len(names)} right"
    with open(out, "w") as page:
        page.write(
            "<!doctype html><meta charset=utf-8><title>photonmill and Cycles</title><style>body{font:14px sans-serif;margin:2em}"
            "td,th{padding:.15em .8em;text-align:right}td:first-child{text-align:left}img{image-rendering:pixelated;margin-right:4px}"
            f"small{{font-weight:normal}}</style><h1>photonmill and Cycles: {title}</h1><p>Ratio of the means of covered pixels "
            f"(within {MEANS:.0%}), relative RMS difference of 4 x 4 blocks (within {BLOCKS:.0%}) and of those in highlights (within "
            f"{HIGHLIGHTS:.0%}).<table>{line('th', header)}{''.join(map(linked, rows))}</table>{''.join(shown)}"
        )
    print(title)
    sys.exit(wrong > 0)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        raise SystemExit("usage: compare_page.py PICTURES REFS OUT.html")
    main(*sys.argv[1:])
