"""The live page: a simulation or a cache in the browser, where it can be turned, changed and grabbed.

A `Subject` says what is looked at, a `Player` makes its frames and takes inputs (`live`: a simulation, `playback`: a
cache), a `Session` runs a player in a thread of its own, `pack` turns frames into bytes, and `server` hands them to
pages. What goes over the wire is in `messages`; the page's types are made from it by `typescript`.
"""
