"""The public names, each from its home. `__init__.py` reads this list: they are imported on first use."""

from .bodies import (
    BODIES as BODIES,
)
from .bodies import (
    Body as Body,
)
from .bodies import (
    chain as chain,
)
from .bodies import (
    cloth as cloth,
)
from .bodies import (
    cloth_from_mesh as cloth_from_mesh,
)
from .bodies import (
    cloud as cloud,
)
from .bodies import (
    fish as fish,
)
from .bodies import (
    hair as hair,
)
from .bodies import (
    jelly as jelly,
)
from .bodies import (
    lattice as lattice,
)
from .bodies import (
    net as net,
)
from .bodies import (
    points as points,
)
from .bodies import (
    scatter as scatter,
)
from .bodies import (
    snake as snake,
)
from .bodies import (
    worm as worm,
)
from .cache import (
    Cache as Cache,
)
from .cache import (
    record as record,
)
from .collisions import (
    COLLIDERS as COLLIDERS,
)
from .collisions import (
    Box as Box,
)
from .collisions import (
    Capsule as Capsule,
)
from .collisions import (
    Collider as Collider,
)
from .collisions import (
    Cylinder as Cylinder,
)
from .collisions import (
    DistanceGrid as DistanceGrid,
)
from .collisions import (
    HeightField as HeightField,
)
from .collisions import (
    Mesh as Mesh,
)
from .collisions import (
    Plane as Plane,
)
from .collisions import (
    Polygon as Polygon,
)
from .collisions import (
    Sphere as Sphere,
)
from .collisions import (
    respond as respond,
)
from .collisions import (
    respond_pair as respond_pair,
)
from .constraints import (
    CONSTRAINTS as CONSTRAINTS,
)
from .constraints import (
    Attachment as Attachment,
)
from .constraints import (
    Constraint as Constraint,
)
from .constraints import (
    SelfContact as SelfContact,
)
from .constraints import (
    StrainLimit as StrainLimit,
)
from .constraints import (
    SurfaceContact as SurfaceContact,
)
from .constraints import (
    Tear as Tear,
)
from .controllers import (
    CONTROLLERS as CONTROLLERS,
)
from .controllers import (
    Controller as Controller,
)
from .controllers import (
    FishBrain as FishBrain,
)
from .controllers import (
    Steer as Steer,
)
from .controllers import (
    Swim as Swim,
)
from .emitters import (
    EMITTERS as EMITTERS,
)
from .emitters import (
    BoxEmitter as BoxEmitter,
)
from .emitters import (
    Emitter as Emitter,
)
from .emitters import (
    LineEmitter as LineEmitter,
)
from .emitters import (
    MeshEmitter as MeshEmitter,
)
from .emitters import (
    Normal as Normal,
)
from .emitters import (
    Nozzle as Nozzle,
)
from .emitters import (
    PointEmitter as PointEmitter,
)
from .emitters import (
    ShapedEmitter as ShapedEmitter,
)
from .emitters import (
    SphereEmitter as SphereEmitter,
)
from .emitters import (
    Spread as Spread,
)
from .errors import (
    Diverged as Diverged,
)
from .errors import (
    DividedStep as DividedStep,
)
from .errors import (
    InvalidInput as InvalidInput,
)
from .errors import (
    PointmassError as PointmassError,
)
from .errors import (
    UnstableStep as UnstableStep,
)
from .forces import (
    FORCES as FORCES,
)
from .forces import (
    Angles as Angles,
)
from .forces import (
    Attractor as Attractor,
)
from .forces import (
    Avoid as Avoid,
)
from .forces import (
    Bulk as Bulk,
)
from .forces import (
    Buoyancy as Buoyancy,
)
from .forces import (
    Cruise as Cruise,
)
from .forces import (
    CurlNoise as CurlNoise,
)
from .forces import (
    Cushion as Cushion,
)
from .forces import (
    Diffusion as Diffusion,
)
from .forces import (
    Drag as Drag,
)
from .forces import (
    Field as Field,
)
from .forces import (
    Fins as Fins,
)
from .forces import (
    Flee as Flee,
)
from .forces import (
    Flocking as Flocking,
)
from .forces import (
    Flow as Flow,
)
from .forces import (
    Flutter as Flutter,
)
from .forces import (
    Force as Force,
)
from .forces import (
    Gravitation as Gravitation,
)
from .forces import (
    Gravity as Gravity,
)
from .forces import (
    Gust as Gust,
)
from .forces import (
    Harmonic as Harmonic,
)
from .forces import (
    Hinges as Hinges,
)
from .forces import (
    LennardJones as LennardJones,
)
from .forces import (
    LineAttractor as LineAttractor,
)
from .forces import (
    Magnetic as Magnetic,
)
from .forces import (
    Muscles as Muscles,
)
from .forces import (
    PlateWind as PlateWind,
)
from .forces import (
    PointVortices as PointVortices,
)
from .forces import (
    QuadraticDrag as QuadraticDrag,
)
from .forces import (
    RingAttractor as RingAttractor,
)
from .forces import (
    Scales as Scales,
)
from .forces import (
    Seek as Seek,
)
from .forces import (
    SlenderDrag as SlenderDrag,
)
from .forces import (
    SoftSphere as SoftSphere,
)
from .forces import (
    Springs as Springs,
)
from .forces import (
    SurfaceAttractor as SurfaceAttractor,
)
from .forces import (
    Volumes as Volumes,
)
from .forces import (
    Vortex as Vortex,
)
from .forces import (
    VortexLine as VortexLine,
)
from .forces import (
    VortexRing as VortexRing,
)
from .forces import (
    Water as Water,
)
from .forces import (
    Wind as Wind,
)
from .forces import (
    load_grid as load_grid,
)
from .frame import (
    Arrows as Arrows,
)
from .frame import (
    Camera as Camera,
)
from .frame import (
    Curves as Curves,
)
from .frame import (
    Frame as Frame,
)
from .frame import (
    Points as Points,
)
from .frame import (
    Segments as Segments,
)
from .frame import (
    Triangles as Triangles,
)
from .laws.arrays import (
    ArrayForce as ArrayForce,
)
from .laws.arrays import (
    array_force as array_force,
)
from .laws.elements import (
    element_force as element_force,
)
from .laws.elements import (
    spring_force as spring_force,
)
from .laws.grid import (
    Grid as Grid,
)
from .laws.pairs import (
    pair_force as pair_force,
)
from .laws.unary import (
    unary_force as unary_force,
)
from .laws.unary import (
    velocity_field as velocity_field,
)
from .look import (
    Look as Look,
)
from .motions import (
    MOTIONS as MOTIONS,
)
from .motions import (
    RigidMotion as RigidMotion,
)
from .particles import (
    Particles as Particles,
)
from .render import (
    Style as Style,
)
from .render import (
    fit_camera as fit_camera,
)
from .render import (
    image as image,
)
from .render import (
    write as write,
)
from .scene import (
    Scene as Scene,
)
from .scene import (
    body_of as body_of,
)
from .scenes import (
    SCENES as SCENES,
)
from .simulation import (
    Simulation as Simulation,
)
from .solvers import (
    BDF2 as BDF2,
)
from .solvers import (
    RK4 as RK4,
)
from .solvers import (
    SOLVERS as SOLVERS,
)
from .solvers import (
    XPBD as XPBD,
)
from .solvers import (
    BogackiShampine as BogackiShampine,
)
from .solvers import (
    DormandPrince as DormandPrince,
)
from .solvers import (
    Euler as Euler,
)
from .solvers import (
    Event as Event,
)
from .solvers import (
    FunctionSystem as FunctionSystem,
)
from .solvers import (
    Heun as Heun,
)
from .solvers import (
    ImplicitEuler as ImplicitEuler,
)
from .solvers import (
    ImplicitMidpoint as ImplicitMidpoint,
)
from .solvers import (
    Leapfrog as Leapfrog,
)
from .solvers import (
    Midpoint as Midpoint,
)
from .solvers import (
    SymplecticEuler as SymplecticEuler,
)
from .solvers import (
    Yoshida4 as Yoshida4,
)
from .solvers import (
    integrate as integrate,
)
from .stability import (
    Stability as Stability,
)
from .system import (
    ParticleSystem as ParticleSystem,
)
from .tracing.functions import (
    absolute as absolute,
)
from .tracing.functions import (
    add as add,
)
from .tracing.functions import (
    atan2 as atan2,
)
from .tracing.functions import (
    cos as cos,
)
from .tracing.functions import (
    cross as cross,
)
from .tracing.functions import (
    dot as dot,
)
from .tracing.functions import (
    exp as exp,
)
from .tracing.functions import (
    floor as floor,
)
from .tracing.functions import (
    inverse as inverse,
)
from .tracing.functions import (
    length as length,
)
from .tracing.functions import (
    log as log,
)
from .tracing.functions import (
    maximum as maximum,
)
from .tracing.functions import (
    minimum as minimum,
)
from .tracing.functions import (
    pow as pow,
)
from .tracing.functions import (
    scale as scale,
)
from .tracing.functions import (
    sin as sin,
)
from .tracing.functions import (
    sqrt as sqrt,
)
from .tracing.functions import (
    sub as sub,
)
from .tracing.functions import (
    tan as tan,
)
from .tracing.functions import (
    where as where,
)
from .tracing.noise import (
    noise as noise,
)
from .viewer.film import (
    to_html as to_html,
)
from .viewer.show import (
    show as show,
)
from .zones import (
    ZONES as ZONES,
)
from .zones import (
    BoxZone as BoxZone,
)
from .zones import (
    HalfSpaceZone as HalfSpaceZone,
)
from .zones import (
    SphereZone as SphereZone,
)

__version__: str
