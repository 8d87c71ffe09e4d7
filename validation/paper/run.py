"""Runs every figure, draws the pictures, and writes what was found into README.md between its marks.

python validation/paper/run.py
"""

import importlib
import sys

from drawing import write
from study import HERE

FIGURES = (
    "fig01",
    "fig03",
    "fig04",
    "fig07",
    "fig08",
    "fig09",
    "fig10",
    "fig12",
    "fig13",
    "fig14",
    "fig15",
    "fig17",
    "fig20",
    "disc",
)
BEGIN, END = "<!-- written by run.py -->\n", "<!-- end -->\n"


def main() -> int:
    summary = ["| figure | what it shows | checks | held |", "|---|---|---|---|"]
    sections: list[str] = []
    good = True
    for name in FIGURES:
        module = importlib.import_module(name)
        checks = module.run()
        first = module.__doc__.strip().splitlines()[0].rstrip(":")
        held = sum(line[3] for line in checks.lines)
        good &= checks.good
        title = first.split(": ")[0] if first.startswith("Fig") else "The exact field of the disc"
        says = first.split(": ", 1)[-1].rstrip(".")
        print(f"{title}: {held} of {len(checks.lines)} checks hold", flush=True)
        summary.append(f"| [{checks.figure}]({name}.py) | {says} | {len(checks.lines)} | {'all' if checks.good else held} |")
        sections += [f"### {title}", "", f"{says[0].upper()}{says[1:]}.", ""]
        for picture, scene in checks.scenes.items():
            write(scene(), HERE / f"{picture}.png")
            sections += [f"![{picture}]({picture}.png)", ""]
        sections += ["| | expected | found | |", "|---|---|---|---|"]
        sections += [f"| {what} | {wanted} | {found} | {'yes' if ok else '**no**'} |" for what, wanted, found, ok in checks.lines]
        sections.append("")
    readme = HERE / "README.md"
    before, rest = readme.read_text().split(BEGIN)
    after = rest.split(END)[1]
    readme.write_text(before + BEGIN + "\n" + "\n".join([*summary, "", *sections]) + END + after)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
