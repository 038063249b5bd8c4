"""Draws the pictures of docs/concepts.md: `python3 docs/pictures/concepts.py`, beside this file.

What it shows was measured, on ten built-in objects trained with `palpate train`, by
`palpate touch --object hammer --mesh hammer.stl --readings 8 --seed 101`: the fourth press, what
`POST /v1/sensors/{sensor}/check` says of it, and the beliefs after 0 to 6 readings (`?at=n`).
"""

from pathlib import Path

PRESS = [
    [2578, 4531, 5938, 6875, 6250, 4766],
    [3984, 5625, 6953, 7422, 6484, 5156],
    [4453, 6172, 7188, 7188, 6016, 4219],
    [4531, 5938, 6406, 5859, 4844, 3203],
    [4453, 5156, 5078, 4375, 3125, 1797],
    [3672, 4141, 3516, 2656, 1797, 1094],
]
"""Pressures of the fourth press, Pa."""

CONTACT = {*range(1, 23), *range(24, 28), 31}
"""The taxels of it that `check` says are in contact, row by row."""

BELIEFS = [
    {"hammer": 0.095, "pliers": 0.095, "hand": 0.095, "unknown": 0.050, "bits": 3.44},
    {"hammer": 0.285, "pliers": 0.386, "hand": 0.163, "unknown": 0.036, "bits": 2.35},
    {"hammer": 0.353, "pliers": 0.214, "hand": 0.077, "unknown": 0.338, "bits": 1.97},
    {"hammer": 0.553, "pliers": 0.325, "hand": 0.049, "unknown": 0.015, "bits": 1.63},
    {"hammer": 0.998, "pliers": 0.000, "hand": 0.000, "unknown": 0.002, "bits": 0.02},
    {"hammer": 0.994, "pliers": 0.000, "hand": 0.000, "unknown": 0.006, "bits": 0.05},
    {"hammer": 1.000, "pliers": 0.000, "hand": 0.000, "unknown": 0.000, "bits": 0.00},
]
"""Probabilities after so many readings; what is left is that of the other seven objects."""

INK, SOFT, PAPER, LINE = "#1d2733", "#5b6875", "#ffffff", "#c9d1d9"
SESSION, SENSOR, OBJECT = "#1f6feb", "#b3541e", "#2d7d46"
COLORS = {"hammer": OBJECT, "pliers": "#8a63d2", "hand": "#c98a1b", "others": "#b8c2cc", "unknown": "#3d4650"}


def text(x, y, words, color=INK, size=13, anchor="start", weight="normal", family="sans-serif"):
    """A line of words."""
    return (
        f'<text x="{x}" y="{y}" fill="{color}" font-size="{size}" text-anchor="{anchor}" '
        f'font-weight="{weight}" font-family="{family}">{words}</text>'
    )


def code(x, y, words, color=INK, size=13, anchor="start"):
    """A name as it stands in the API."""
    return text(x, y, words, color, size, anchor, family="monospace")


def line(x1, y1, x2, y2, color=INK, width=1.5, dash="", arrow=False):
    """A line, with an arrow's head at its end if asked."""
    head = f' marker-end="url(#head-{color[1:]})"' if arrow else ""
    dash = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{color}" stroke-width="{width}"{dash}{head}/>'


def box(x, y, width, height, fill, stroke="none", radius=0):
    """A rectangle."""
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="{radius}" fill="{fill}" stroke="{stroke}"/>'


def write(name, width, height, title, parts, top=0):
    """The picture as a file, on paper of its own so that dark pages show it too."""
    heads = "".join(
        f'<marker id="head-{c[1:]}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" '
        f'markerHeight="7" orient="auto"><path d="M0 0L10 5L0 10z" fill="{c}"/></marker>'
        for c in (INK, SOFT, SESSION, SENSOR, OBJECT)
    )
    body = "\n".join(parts)
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 {top} {width} {height - top}" '
        f'width="{width}" height="{height - top}" role="img"><title>{title}</title><defs>{heads}</defs>\n'
        f"{box(0, 0, width, height, PAPER)}\n{body}\n</svg>\n"
    )
    (Path(__file__).parent / f"{name}.svg").write_text(svg)


def axes(x, y, along, color, labels, length=46):
    """Two axes from a point; `along` holds their directions on the paper."""
    parts = [f'<circle cx="{x}" cy="{y}" r="4" fill="{color}"/>']
    for (dx, dy), label in zip(along, labels):
        parts.append(line(x, y, x + dx * length, y + dy * length, color, 2.5, arrow=True))
        parts.append(text(x + dx * (length + 14), y + dy * (length + 14) + 5, label, color, 13, "middle", "bold"))
    return parts


def curve(path, color, dash=""):
    """A bent arrow between frames."""
    dash = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<path d="{path}" fill="none" stroke="{color}" stroke-width="1.8"{dash} marker-end="url(#head-{color[1:]})"/>'


def frames():
    """Session, sensor and object, and the poses between them."""
    parts = [
        line(30, 352, 730, 352, LINE, 2),
        # The robot: base, two links, the sensor's plate.
        box(80, 312, 60, 40, "#e6eaee", LINE, 4),
        line(110, 312, 150, 190, "#cfd6dd", 16),
        line(150, 190, 322, 118, "#cfd6dd", 14),
        '<circle cx="150" cy="190" r="11" fill="#b8c2cc"/>',
        # The object: a hammer on the table, turned.
        '<g transform="translate(571 258) rotate(-24)">',
        box(-24, -70, 56, 140, "#dcefe2", OBJECT, 8),
        box(32, -14, 136, 28, "#dcefe2", OBJECT, 6),
        "</g>",
        # The sensor, pressed against the head's side.
        '<g transform="translate(516 240) rotate(66)">',
        box(-34, 14, 68, 12, "#e9c7b2", SENSOR, 2),
        box(-34, 2, 68, 12, "#f7e6db", SENSOR, 2),
        "</g>",
        line(322, 118, 496, 246, "#cfd6dd", 12),
        '<circle cx="322" cy="118" r="10" fill="#b8c2cc"/>',
        *axes(110, 332, [(1, 0), (0, -1)], SESSION, ["x", "z"]),
        *axes(516, 240, [(0.914, -0.407), (0.407, 0.914)], SENSOR, ["z", "x"], 34),
        *axes(593, 248, [(0.914, -0.407), (-0.407, -0.914)], OBJECT, ["x", "y"], 46),
        text(40, 392, "session frame", SESSION, 14, weight="bold"),
        text(40, 410, "the robot's base, or the world", SOFT, 12),
        text(440, 316, "sensor frame", SENSOR, 14, "middle", "bold"),
        text(700, 120, "object frame", OBJECT, 14, "middle", "bold"),
        text(700, 138, "centroid, axes of", SOFT, 12, "middle"),
        text(700, 154, "the mesh", SOFT, 12, "middle"),
        curve("M130 322 C 240 300 380 300 506 250", SENSOR),
        code(190, 258, "session_from_sensor", SENSOR),
        text(190, 275, "you send it with each reading", SOFT, 12),
        curve("M130 336 C 300 440 590 420 594 260", OBJECT, "6 4"),
        code(250, 424, "session_from_object", OBJECT),
        text(250, 441, "the answer", SOFT, 12),
        text(520, 418, "z of the sensor looks at the object;", SOFT, 12),
        text(520, 434, "x along columns, y along rows", SOFT, 12),
    ]
    write("concepts-frames", 760, 456, "Session, sensor and object frames, and the poses between them", parts, top=80)


def reading():
    """A press: what the covering does, what the taxels say, what is in contact."""
    parts = [text(20, 30, "what happens", INK, 14, weight="bold")]
    x0, y0, cell = 20, 60, 30
    # Cross-section: the object's edge in the covering, the spread, the taxels below.
    parts += [
        '<path d="M70 60 L70 92 Q100 118 130 92 L130 60z" fill="#dcefe2" stroke="#2d7d46" stroke-width="1.5"/>',
        '<path d="M20 96 L62 96 Q100 122 138 96 L180 96 L180 140 L20 140z" fill="#f7e6db" stroke="#b3541e"/>',
        *[box(x0 + 2 + i * 27, 142, 23, 9, "#e9c7b2", SENSOR) for i in range(6)],
        '<path d="M20 226 C 60 226 70 166 100 166 C 130 166 140 226 180 226" fill="none" stroke="#b3541e" stroke-width="2"/>',
        line(20, 226, 180, 226, LINE),
        text(100, 76, "object", OBJECT, 12, "middle"),
        text(188, 122, "covering", SENSOR, 12),
        text(188, 151, "taxels", SENSOR, 12),
        text(188, 200, "pressure: the shape,", SOFT, 12),
        text(188, 215, "blurred by the covering", SOFT, 12),
    ]
    x0 = 345
    parts.append(text(x0, 30, "what you send (kPa)", INK, 14, weight="bold"))
    for row, pressures in enumerate(PRESS):
        for col, pressure in enumerate(pressures):
            share = pressure / 8000
            shade = "#" + "".join(f"{round(a + (b - a) * share):02x}" for a, b in ((250, 160), (240, 64), (232, 20)))
            parts.append(box(x0 + col * cell, y0 + row * cell, cell - 2, cell - 2, shade))
            color = PAPER if share > 0.6 else INK
            parts.append(text(x0 + col * cell + 14, y0 + row * cell + 18, f"{pressure / 1000:.1f}", color, 11, "middle"))
    parts += [
        line(x0, y0 + 188, x0 + 60, y0 + 188, SENSOR, 2, arrow=True),
        text(x0 + 66, y0 + 192, "columns: x of the sensor", SENSOR, 12),
        line(x0 - 9, y0, x0 - 9, y0 + 60, SENSOR, 2, arrow=True),
        text(x0 - 14, y0 + 104, "rows: y", SENSOR, 12, "end"),
    ]
    x0 = 620
    parts.append(text(x0, 30, "what it means", INK, 14, weight="bold"))
    for row in range(6):
        for col in range(6):
            fill = OBJECT if 6 * row + col in CONTACT else "#eef1f4"
            parts.append(box(x0 + col * cell, y0 + row * cell, cell - 2, cell - 2, fill))
    parts += [
        box(x0, y0 + 186, 12, 12, OBJECT), text(x0 + 18, y0 + 196, "the surface is here", SOFT, 12),
        box(x0, y0 + 204, 12, 12, "#eef1f4", LINE), text(x0 + 18, y0 + 214, "here it is not", SOFT, 12),
    ]  # fmt: skip
    write("concepts-reading", 830, 290, "One press: covering, pressures, contact", parts)


def posterior():
    """Probabilities and uncertainty after each of six readings."""
    left, top, height, width, step = 70, 50, 200, 54, 92
    parts = [text(left, 28, "which object it is, after so many readings", INK, 14, weight="bold")]
    for share in (0, 0.5, 1):
        y = top + height * (1 - share)
        parts += [line(left - 8, y, left + 6 * step + width + 8, y, LINE), text(left - 14, y + 4, f"{share:.1f}", SOFT, 12, "end")]
    for n, belief in enumerate(BELIEFS):
        x, y = left + n * step, top + height
        shares = {name: belief[name] for name in ("hammer", "pliers", "hand")}
        shares["others"] = max(0.0, 1 - sum(shares.values()) - belief["unknown"])
        shares["unknown"] = belief["unknown"]
        for name, share in shares.items():
            tall = share * height
            y -= tall
            if tall < 0.3:
                continue
            parts.append(box(x, round(y, 1), width, round(tall, 1), COLORS[name]))
            if tall > 16:
                color = INK if name == "others" else PAPER
                parts.append(text(x + width / 2, round(y + tall / 2 + 4, 1), f"{share:.2f}", color, 12, "middle"))
        parts.append(text(x + width / 2, top + height + 20, str(n), INK, 13, "middle"))
        parts.append(text(x + width / 2, top + height + 42, f"{belief['bits']:.2f}", SOFT, 12, "middle"))
    parts += [
        text(left - 14, top + height + 20, "n", SOFT, 12, "end"),
        text(left - 14, top + height + 42, "bits", SOFT, 12, "end"),
    ]
    x = left + 7 * step + 10
    for i, (name, label) in enumerate(
        [("unknown", "none of these"), ("others", "seven others"), ("hand", "hand"), ("pliers", "pliers"), ("hammer", "hammer")]
    ):
        parts += [box(x, top + 20 + i * 26, 14, 14, COLORS[name]), text(x + 22, top + 32 + i * 26, label, INK, 13)]
    write("concepts-posterior", 870, 310, "Probabilities of ten objects after none to six readings of a hammer", parts)


frames()
reading()
posterior()
