"""Outlines of SVG files: clones, lengths, pages, visibility, and what is refused."""

import numpy as np
import pytest

from skfem_textile import Outline

PAGE = 'width="100mm" height="100mm" viewBox="0 0 100 100"'
SQUARE = '<rect width="100" height="100"/>'
ROUND = 100 * np.pi  # area of a circle of radius 10


@pytest.fixture
def read(tmp_path, caplog):
    """Reads a drawing; returns the outline, and the log as text."""

    def outline(content, page=PAGE, **options):
        file = tmp_path / "a.svg"
        names = 'xmlns="http://www.w3.org/2000/svg"'
        xlink = 'xmlns:xlink="http://www.w3.org/1999/xlink"'
        file.write_text(f"<svg {names} {xlink} {page}>{content}</svg>")
        caplog.clear()
        return Outline.from_svg(file, **options), caplog.text

    return outline


def test_shapes_paths_and_transforms(read):
    """A plate of 100 mm by 80 mm with a round corner, a slot and a round hole."""
    outline, _ = read(
        """<path id="lower" d="M 0 40 h40 a10,10 0 0010-10"/>
        <g transform="translate(5 0)"><polyline points="45,30 45,0 -5,0"/></g>
        <path d="M0,0V40"/>
        <circle cx="10" cy="10" r="5"/>
        <path d="M20 20 L 30 20 Q 35 20 35 25 T 30 30 L 20 30 Z"/>
        <text x="3">note</text>""",
        'width="20cm" viewBox="0 0 100 100"',
        tolerance=1e-3,
    )
    assert outline.polygon.min(axis=1).tolist() == [0, -80]
    assert outline.polygon.max(axis=1).tolist() == [100, 0]
    plate = 100 * 80 - 20**2 * (1 - np.pi / 4)
    # The parabola with corners (30, 20), (35, 25) and control point (35, 20) cuts off
    # a sixth of the square of its controls.
    slot = 4 * (15 * 10 - 2 * 25 / 6)
    assert outline.shape().area == pytest.approx(plate - np.pi * 10**2 - slot, abs=0.2)
    assert "lower" in outline.boundaries
    assert outline.boundaries["lower"].sum() > 10
    gap = np.hypot(*(outline.polygon - [[80], [-60]]))  # about the round corner
    at_corner = (outline.polygon[0] > 80.001) & (outline.polygon[1] < -60.001)
    assert gap[at_corner] == pytest.approx(20, abs=1e-9)


@pytest.mark.parametrize(
    ("content", "area"),
    [
        ('<circle id="h" cx="30" cy="50" r="10"/><use href="#h" x="40"/>', 2 * ROUND),
        (
            '<defs><circle id="h" r="10"/></defs><use xlink:href="#h" x="50" y="50"/>',
            ROUND,
        ),
        ('<symbol id="h"><circle cx="10" cy="10" r="10"/></symbol>', 0),
        (
            '<symbol id="h" viewBox="0 0 2 2"><circle cx="1" cy="1" r="1"/></symbol>'
            '<use href="#h" x="40" y="40" width="20" height="20"/>',
            ROUND,
        ),
        ('<svg x="20" y="50"><circle cx="10" cy="10" r="10"/></svg>', ROUND),
        (
            '<svg x="9" y="9" width="40" height="40" viewBox="0 0 20 20">'
            '<circle cx="10" cy="10" r="5"/></svg>',
            ROUND,
        ),
        ('<circle cx="50%" cy="50%" r="10"/>', ROUND),
        ('<circle style="r:10px;cx:50px;cy:50px"/>', ROUND),
        ('<style>#h{r:10px}</style><circle id="h" cx="50" cy="50"/>', ROUND),
        ('<circle r="10" style="transform:translate(50px,50px)"/>', ROUND),
        ('<circle r="5" transform="translate(50 50)scale(2)rotate(30)"/>', ROUND),
        ('<rect x="40" y="40" width="20" height="20" rx="10"/>', ROUND),
        ('<circle cx="50" cy="50" r="10"/>' * 2, ROUND),
        ('<circle cx="50" cy="50" r="10" transform="rotate(9 50 50)"/>' * 2, ROUND),
    ],
)
def test_holes_are_read_wherever_they_are_stored(read, content, area):
    outline, _ = read(SQUARE + content)
    assert 1e4 - outline.shape().area == pytest.approx(area, abs=1.5)


@pytest.mark.parametrize(
    "content",
    [
        '<circle style="display:none" cx="50" cy="50" r="10"/>',
        '<g display="none"><circle cx="50" cy="50" r="10"/></g>',
        '<g visibility="hidden"><circle cx="50" cy="50" r="10"/></g>',
        '<style>.no {display: none !important}</style><circle class="a no" r="10"/>',
        '<circle fill="none" cx="50" cy="50" r="10"/>',
        '<g style="fill-opacity:0"><circle cx="50" cy="50" r="10"/></g>',
        '<circle opacity="0" cx="50" cy="50" r="10"/>',
        '<text x="50" y="50">10</text>',
    ],
)
def test_what_is_not_visible_does_not_count_and_is_named(read, content):
    outline, said = read(SQUARE + content)
    assert not outline.holes
    assert "ignored: 1 " in said


@pytest.mark.parametrize("tag", ["pattern", "symbol", "clipPath"])
def test_definitions_are_not_drawn(read, tag):
    outline, said = read(f'{SQUARE}<{tag}><circle cx="50" cy="50" r="20"/></{tag}>')
    assert not outline.holes
    assert not said


def test_the_visible_child_of_a_hidden_group_counts(read):
    child = '<circle visibility="visible" cx="50" cy="50" r="10"/>'
    outline, _ = read(f'{SQUARE}<g visibility="hidden">{child}</g>')
    assert len(outline.holes) == 1


@pytest.mark.parametrize(
    ("page", "content", "area"),
    [
        ("", '<rect width="100mm" height="100mm"/>', 1e4),
        ('width="20cm" height="20cm"', '<rect width="10cm" height="10cm"/>', 1e4),
        ('width="200px" height="200px"', '<rect width="10cm" height="10cm"/>', 1e4),
        (PAGE, '<rect width="100%" height="100%"/>', 1e4),
        ('width="200mm" height="100mm" viewBox="0 0 100 100"', SQUARE, 1e4),
        ('height="200mm" viewBox="0 0 100 100"', SQUARE, 4e4),
        ('width="100pc" height="100pc" viewBox="0 0 100 100"', SQUARE, 179211.111),
        ('width="400Q" height="400Q" viewBox="0 0 100 100"', SQUARE, 1e4),
        ('style="width:50mm" viewBox="0 0 100 100"', SQUARE, 2500),
        (
            'width="100mm" height="200mm" viewBox="0 0 100 100" '
            'preserveAspectRatio="none"',
            SQUARE,
            2e4,
        ),
        (
            'width="200mm" height="100mm" viewBox="0 0 100 100" '
            'preserveAspectRatio="xMinYMin slice"',
            SQUARE,
            4e4,
        ),
    ],
)
def test_units_and_pages_set_the_scale(read, page, content, area):
    assert read(content, page)[0].shape().area == pytest.approx(area)


def test_a_drawing_without_a_unit_is_in_mm_and_the_unit_can_be_given(read):
    page = 'width="100%" viewBox="0 0 100 100"'
    outline, said = read(SQUARE, page)
    assert outline.shape().area == pytest.approx(1e4)
    assert "states no unit: one unit of it is read as 1 mm" in said
    outline, said = read(SQUARE, page, unit="cm")
    assert outline.shape().area == pytest.approx(1e6)
    assert not said
    with pytest.raises(ValueError, match="the unit must be one of mm, cm, m, in"):
        read(SQUARE, unit="feet")


LABEL = 'xmlns:i="http://www.inkscape.org/namespaces/inkscape" i:label="Cut"'


@pytest.mark.parametrize(
    ("content", "options"),
    [
        (f'<rect width="150" height="150"/><g {LABEL}>{SQUARE}</g>', {"layer": "Cut"}),
        (
            f'<circle r="300" clip-path="url(#c)"/><g id="ply">{SQUARE}</g>',
            {"layer": "ply"},
        ),
        (f'<switch><g systemLanguage="x"/>{SQUARE}<circle r="500"/></switch>', {}),
        (f"<style>rect:hover, g rect {{fill: #ff0}}</style>{SQUARE}", {}),
    ],
    ids=["a label", "a clip on another layer", "a switch", "a colour"],
)
def test_only_the_square_is_the_ply(read, content, options):
    assert read(content, **options)[0].shape().area == pytest.approx(1e4)


@pytest.mark.parametrize(
    "hole",
    [
        '<circle class="a" r="1" style="r:10px"/>',
        '<circle class="a b" r="1"/>',
        '<circle class="c" r="1" style="r:1px"/>',
        '<circle id="d" class="a" r="1"/>',
    ],
)
def test_styles_apply_by_importance_and_specificity(read, hole):
    style = """<style>#d{r:10px} .b{r:10px} .a{r:1px} .c{r:10px !important}
    .b.a{r:10px} circle{r:3px;cx:50px;cy:50px} rect{r:10px;cx:1px}</style>"""
    outline, _ = read(style + SQUARE + hole)
    assert 1e4 - outline.shape().area == pytest.approx(ROUND, abs=1.5)


def test_layers_are_ids_of_groups_and_elements(read):
    frame = '<g id="page"><rect id="frame" x="-9" y="-9" width="150" height="150"/></g>'
    part = f'<g id="part">{SQUARE}<circle id="hole" cx="50" cy="50" r="10"/></g>'
    for layer in ("part", ["part", "hole"]):
        outline, said = read(frame + part, layer=layer)
        assert outline.shape().area == pytest.approx(1e4 - ROUND, abs=1.5)
        assert "the ply is 100 x 100 mm (rect of 'part')" in said
        assert "hole(s) 20 x 20 mm (circle 'hole')" in said
    with pytest.raises(ValueError, match=r"'no'; it has lines on 'page', 'frame', 'pa"):
        read(frame + part, layer="no")
    with pytest.raises(ValueError, match="layer has no name"):
        read(frame + part, layer=[])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<path d='M0 0 L9 0 L9 9 L0 5'/>", r"1 line\(s\) end at .* of path"),
        ("<path d='M0 0 B1 0'/>", "the path is not valid near 'B1 0'"),
        ("<path d='M0 0 L1'/>", "the path is not valid near 'L'"),
        ("<path d='L0 0 L1 1'/>", "the path is not valid near 'LL1 1'"),
        ("<polygon points='0 0 1 0 1'/>", "odd number of coordinates"),
        ("<polygon points='0 0 1 x'/>", "'0 0 1 x' are not numbers"),
        ("", "has no lines"),
        ("<image/>", "has no lines; ignored: 1 image"),
        (
            "<circle id='a' r='9' clip-path='url(#c)'/>",
            r"circle 'a' has clip-path 'url\(#c\)'",
        ),
        ("<g style='mask:url(#m)'><circle r='9'/></g>", "g has mask"),
        ("<path transform='skewZ(3)'/>", r"transform 'skewZ\(3\)' is not"),
        ("<g transform='rotate'/>", "the transform 'rotate' is not"),
        (
            "<circle r='9' style='transform-origin:50%'/>",
            "-origin '50%'",
        ),
        ("<circle r='9' style='translate:3px'/>", "has the style translate"),
        ("<style>g > path {display:none}</style>", "the selector 'g > path' of a"),
        ("<style>@media print {path{r:1}}</style>", "rule '@media print' is not"),
        ("<circle r='3em'/>", "circle: the length '3em' is not supported"),
        ("<circle r='-1'/>", "a length is negative"),
        ("<use href='#no'/>", "use refers to '#no', which is not an element"),
        ("<g id='a'><use href='#a'/></g>", "use refers to itself"),
        (
            "<svg width='5' height='5'><circle cx='5' cy='5' r='5'/></svg>",
            "svg cuts off what is outside",
        ),
        (200 * "<g>" + 200 * "</g>", "nested too deeply"),
    ],
)
def test_what_is_not_supported_is_refused_in_one_line(read, content, message):
    with pytest.raises(ValueError, match=message) as error:
        read(content)
    assert "\n" not in str(error.value)


def test_clones_of_clones_are_limited(read, monkeypatch):
    monkeypatch.setattr("skfem_textile.outlines.rings._MOST", 500)
    group = '<g id="n0"/>'
    for i in range(3):
        group += f'<g id="n{i + 1}">' + 10 * f'<use href="#n{i}"/>' + "</g>"
    with pytest.raises(ValueError, match="has more than 500 elements"):
        read(group)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<html/>", "is not an SVG file"),
        ("<svg", "the file is not valid XML: unclosed token"),
        ("<?xml-stylesheet href='a.css'?><svg/>", "style sheets of other files"),
        (
            "<svg transform='scale(2)'><circle r='5'/></svg>",
            "a transform of all is not",
        ),
        ("<svg><circle r='5%'/></svg>", "5% of a drawing without width"),
    ],
)
def test_bad_files_are_refused(tmp_path, text, message):
    (tmp_path / "a.svg").write_text(text)
    with pytest.raises(ValueError, match=message):
        Outline.from_svg(tmp_path / "a.svg")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            SQUARE + '<circle id="c" cx="100" cy="50" r="9"/>',
            r"100 x 100 mm \(rect\) and 18 x 18 mm \(circle 'c'\) touch or cross at",
        ),
        ('<path d="M0 0H9V9L5 -5Z"/>', "path: the line crosses or touches itself"),
    ],
)
def test_one_ply_is_one_piece(read, content, message):
    with pytest.raises(ValueError, match=message):
        read(content)
