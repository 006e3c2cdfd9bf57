"""Settings of shipped scenes with which they do not take long."""

SMALL: dict[str, dict[str, object]] = {  # fewer particles where the default takes long; the physics is the same
    "flow": {"particles": 200, "arrows": 6, "streamlines": 6},
    "springs": {"side": 4},
    "fountain": {"rate": 200},
    "fireworks": {"height": 8.0, "stars": 40, "launches": 4.0, "smoke": 3, "tail": 20.0},
    "snow": {"rate": 60.0},
    "smoke": {"rate": 60.0},
    "bounce": {"balls": 20},
    "dust": {"sand": 400, "dust": 60.0},
    "cloth": {"particles": 20},
    "flag": {"particles": 20},
    "drape": {"particles": 20},
    "hair": {"strands": 40, "children": 2},
}
