"""Small meshes, as vertices and faces, and the file of a cloud, that several tests use."""

from pathlib import Path

TETRAHEDRON = (
    [[0.9, 0.9, 0.9], [0.9, -0.9, -0.9], [-0.9, 0.9, -0.9], [-0.9, -0.9, 0.9]],
    [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
)
SHEET = ([[-1, 0, -1], [-1, 0.2, 1], [1, 0.5, 1], [1, -0.1, -1], [0, 0.8, 0]], [[0, 1, 4], [1, 2, 4], [2, 3, 4]])
CLOUD = str(Path(__file__).with_name("cloud.csv"))
