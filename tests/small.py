"""Settings of shipped scenes with which they do not take long."""

SMALL: dict[str, dict[str, object]] = {  # fewer particles where the default takes long; the physics is the same
    "flow": {"particles": 200, "arrows": 6, "streamlines": 6},
    "field": {"particles": 40, "arrows": 6, "streamlines": 6},
    "springs": {"side": 4},
    "fountain": {"rate": 200},
    "fireworks": {"height": 8.0, "stars": 40, "launches": 4.0, "smoke": 3, "tail": 20.0},
    "snow": {"rate": 60.0},
    "smoke": {"rate": 60.0},
    "bounce": {"balls": 20},
    "dust": {"sand": 400, "dust": 60.0},
    "flock": {"animals": 60, "pillars": 1, "predators": 1},
    "cloth": {"particles": 12},
    "flag": {"particles": 12},
    "drape": {"particles": 12},
    "tear": {"particles": 16},
    "curtain": {"particles": 13, "rings": 5, "stretch": 180.0},
    "net": {"balls": 3, "size": 1.2, "mesh": 0.6},
    "jelly": {"particles": 4},
    "heap": {"cloths": 2, "particles": 10},
    "hair": {"strands": 16, "children": 2},
    "school": {"fish": 16},
}
