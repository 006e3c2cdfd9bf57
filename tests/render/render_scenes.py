"""Small frames that the tests draw."""

import numpy as np

from pointmass.frame import Arrows, Camera, Curves, Frame, Points, Segments, Triangles

FRONT = Camera(position=(0.0, 0.0, 10.0), target=(0.0, 0.0, 0.0), fov=30.0)


def frame(positions, *drawables, number=0, **quantities):
    positions = np.asarray(positions).reshape(-1, 3)
    return Frame(
        number=number,
        time=0.5,
        ids=np.arange(len(positions)),
        positions=positions,
        velocities=np.zeros_like(positions),
        drawables=drawables,
        quantities=quantities,
    )


def square(size=1.0, z=0.0, color=(0.5, 0.5, 0.5, 1.0)):
    corners = np.array([[-size, -size, z], [size, -size, z], [size, size, z], [-size, size, z]])
    return Triangles(name=f"square {z}", vertices=corners, faces=np.array([[0, 1, 2], [0, 2, 3]]), color=color)


def everything(count=60, dtype=np.float64, index=np.int64, seed=3):
    """One of each kind: solid, clear, glowing."""
    random = np.random.default_rng(seed)
    places = random.normal(0.0, 1.0, (count, 3)).astype(dtype)
    colors = np.concatenate([random.uniform(0.1, 2.0, (count, 3)), np.ones((count, 1))], axis=1).astype(dtype)
    rows = np.arange(count, dtype=index)
    third = count // 3
    floor = Triangles(
        name="floor",
        vertices=np.array([[-4, -2, -4], [4, -2, -4], [4, -2, 4], [-4, -2, 4]], dtype=dtype),
        faces=np.array([[0, 2, 1], [0, 3, 2]], dtype=index),
    )
    return frame(
        places,
        floor,
        square(0.7, 1.0, (0.2, 0.4, 0.9, 0.4)),
        Points(name="balls", index=rows[::2], radius=0.15, color=colors[::2]),
        Points(name="smeared", index=rows[1::4], radius=0.1, color=colors[1::4], motion=0.4 * places[::4]),
        Points(name="clear", index=rows[:5], radius=0.3, color=(0.9, 0.2, 0.2, 0.5)),
        Points(name="sparks", index=rows[1::2], radius=0.05, color=colors[1::2], glow=True),
        Points(name="streaks", index=rows[::3], radius=0.05, color=colors[::3], glow=True, motion=0.3 * places[::3]),
        Points(name="smoke", radius=0.3, color=(0.6, 0.5, 0.4, 0.3), soft=True),
        Points(name="flakes", index=rows[::4], radius=0.1, color=(0.8, 0.8, 0.8, 1), normals=places[::4]),
        Segments(name="rods", pairs=np.stack([rows[:-1], rows[1:]], axis=1)[:third], width=0.03),
        Segments(name="rays", pairs=np.stack([rows[:-1], rows[1:]], axis=1)[third:], width=0.03, glow=True),
        Curves(name="trail", index=rows, offsets=np.array([0, third, third, count]), color=(0.2, 0.9, 0.3, 0.5)),
        Arrows(name="field", vertices=places, vectors=places * 0.3, width=0.03),
        energy=1.25,
    )
