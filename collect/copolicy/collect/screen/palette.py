"""The colours of the screen: Okabe and Ito's palette, told apart by people with any common colour blindness.

Colour never says anything alone: the seats differ in shape (triangle, circle), goal and obstacles in pattern.
"""

Colour = tuple[int, int, int]

BLUE: Colour = (0, 114, 178)
ORANGE: Colour = (230, 159, 0)
GREEN: Colour = (0, 158, 115)
VERMILION: Colour = (213, 94, 0)
SKY: Colour = (86, 180, 233)
YELLOW: Colour = (240, 228, 66)

SEATS: tuple[Colour, Colour] = (BLUE, ORANGE)
"""Robot seat (blue triangle), human seat (orange circle)."""

FLOOR: Colour = (247, 246, 241)
FLOOR_DOT: Colour = (222, 220, 212)
SURROUND: Colour = (24, 28, 36)
PANEL: Colour = (35, 41, 53)
PANEL_EDGE: Colour = (62, 71, 89)
SHADOW: Colour = (216, 213, 204)
WOOD: Colour = (178, 132, 88)
WOOD_EDGE: Colour = (116, 80, 47)
OBSTACLE: Colour = (58, 62, 72)
OBSTACLE_STRIPE: Colour = (96, 101, 113)
INK: Colour = (28, 32, 40)
TEXT: Colour = (240, 242, 246)
MUTED: Colour = (160, 170, 187)


def mix(colour: Colour, other: Colour, share: float) -> Colour:
    """`colour` with a share in [0, 1] of another one."""
    red, green, blue = (round(a + share * (b - a)) for a, b in zip(colour, other, strict=True))
    return red, green, blue
