"""Compute the numbers of a page of docs/findings again.

    python3 dev.py findings roof-meters DATA_DIR
    python3 dev.py findings zenith DATA_DIR
    python3 dev.py findings figure-90 DATA_DIR [--out DIR]       about ten minutes

DATA_DIR holds the tables of the Greenwood report as CSV (named in each page). The numbers are printed; with --write
they replace those between the two marks in docs/findings/PAGE.md, and nothing else there.
"""

import argparse
import sys
import tempfile
from pathlib import Path

HOME = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(HOME), str(HOME / "benchmarks")]

PAGES = ("roof-meters", "zenith", "figure-90")
BEGIN = "<!-- computed: python3 dev.py findings {page} DATA_DIR --write -->"
END = "<!-- end of what was computed -->"


def computed(page: str, data: Path, out: Path) -> str:
    """The computed part of a page, as Markdown."""
    if page == "figure-90":
        import explain_figure90

        return explain_figure90.told(explain_figure90.experiment(data, out))
    import explain_greenwood

    return (explain_greenwood.roof_meters if page == "roof-meters" else explain_greenwood.zenith)(data, out)


def with_part(text: str, page: str, part: str) -> str:
    """The page's text with its computed part replaced; raises `ValueError` where the marks are missing."""
    begin = BEGIN.format(page=page)
    if text.count(begin) != 1 or text.count(END) != 1 or text.index(begin) > text.index(END):
        raise ValueError(f"docs/findings/{page}.md has not the two marks, once each:\n{begin}\n{END}")
    head, rest = text.split(begin)
    tail = rest.split(END)[1]
    return f"{head}{begin}\n\n{part.strip()}\n\n{END}{tail}"


def main() -> None:
    """Compute a page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", choices=PAGES)
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, help="keep case and answer here")
    parser.add_argument("--write", action="store_true", help="put the numbers into the page")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = (options.out or Path(folder)).absolute()
        out.mkdir(parents=True, exist_ok=True)
        part = computed(options.page, options.data.absolute(), out)
    print(f"\n{part}")
    if options.write:
        path = HOME / "docs" / "findings" / f"{options.page}.md"
        path.write_text(with_part(path.read_text(encoding="utf-8"), options.page, part), encoding="utf-8")
        print(f"written into {path}")


if __name__ == "__main__":
    main()
