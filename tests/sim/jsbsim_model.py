"""Our aircraft file as an aircraft definition for JSBSim: another integrator, another rigid body, another atmosphere.

Lift and drag are written attached (JSBSim is not asked to stall); the propeller is a table JSBSim interpolates itself.
Surfaces and motor speed are properties that a test sets.
"""

from pathlib import Path

from flightpower.sim.plant import Plant

FT, LBF, SLUG_FT3, LBF_FT = 0.3048, 4.4482216152605, 515.378818, 1.3558179483314


def number(value: float) -> str:
    return f"<value>{value!r}</value>"


def prop(name: str) -> str:
    return f"<property>{name}</property>"


def product(*parts: str) -> str:
    return "<product>" + "".join(parts) + "</product>"


def total(*parts: str) -> str:
    return "<sum>" + "".join(parts) + "</sum>"


def ratio(above: str, below: str) -> str:
    return f"<quotient>{above}{below}</quotient>"


def negative(part: str) -> str:
    return product(number(-1.0), part)


def function(name: str, body: str) -> str:
    return f'<function name="{name}">{body}</function>'


def linear(terms: dict[str, float], constant: float = 0.0) -> str:
    return total(number(constant), *(product(number(k), prop(name)) for name, k in terms.items()))


def propeller_table(plant: Plant, which: int) -> str:
    """cT or cP over J and rpm on the union of the rows' points."""
    rows = plant.propeller.rows
    Js = sorted({J for row in rows for J in row.J} | {2.0})
    head = " ".join(f"{row.rpm:g}" for row in rows)
    body = "\n".join(
        f"{J!r} " + " ".join(repr(float(plant.propeller.coefficients(J, row.rpm)[which])) for row in rows) for J in Js
    )
    return (
        '<table><independentVar lookup="row">test/J</independentVar>'
        f'<independentVar lookup="column">test/rpm</independentVar><tableData>\n{head}\n{body}\n</tableData></table>'
    )


def definition(plant: Plant) -> str:
    aircraft, aero = plant.aircraft, plant.aero
    geometry, mass, D = aircraft.geometry, aircraft.mass, plant.propeller.diameter_m
    alpha, beta = "aero/alpha-rad", "aero/beta-rad"
    elevator, aileron, rudder = "test/elevator", "test/aileron", "test/rudder"
    sa, ca = f"<sin>{prop(alpha)}</sin>", f"<cos>{prop(alpha)}</cos>"
    CL = linear({alpha: aero.CLa, elevator: aero.CLde, "test/q-hat": aero.CLq}, aero.CL0)
    CD = total(
        number(aero.CD0),
        product(
            number(aero.K), f"<pow><difference>{prop('test/CL')}{number(aero.CL_minD)}</difference>{number(2.0)}</pow>"
        ),
    )
    lateral = {"test/p-hat": "p", "test/r-hat": "r", beta: "b", aileron: "da", rudder: "dr"}

    def derivatives(axis: str) -> str:
        return linear({name: getattr(aero, axis + key, 0.0) for name, key in lateral.items()})

    def rate_hat(rate: str, length: str) -> str:
        return product(prop(f"velocities/{rate}-aero-rad_sec"), prop(f"aero/{length}"))

    n_squared = product(prop("test/n"), prop("test/n"))
    # Density in slug/ft^3 times n^2 D^4 in ft^4/s^2 is pounds.
    thrust = product(prop("atmosphere/rho-slugs_ft3"), n_squared, number((D / FT) ** 4), propeller_table(plant, 0))
    load = product(
        prop("atmosphere/rho-slugs_ft3"),
        n_squared,
        number((D / FT) ** 5 / 6.283185307179586),
        propeller_table(plant, 1),
    )
    qS = product(prop("aero/qbar-psf"), prop("metrics/Sw-sqft"))
    momentum = product(number(aircraft.propulsion.propeller_inertia_kgm2 * 6.283185307179586 / LBF_FT), prop("test/n"))
    functions = [
        function("test/p-hat", rate_hat("p", "bi2vel")),
        function("test/q-hat", rate_hat("q", "ci2vel")),
        function("test/r-hat", rate_hat("r", "bi2vel")),
        function(
            "test/J",
            ratio(product(prop("velocities/vt-fps"), number(FT)), product(prop("test/n"), number(D))),
        ),
        function("test/rpm", product(number(60.0), prop("test/n"))),
        function("test/CL", CL),
        function("test/CD", CD),
        function("test/thrust-lbf", thrust),
    ]
    CX = f"<difference>{product(prop('test/CL'), sa)}{product(prop('test/CD'), ca)}</difference>"
    CZ = negative(total(product(prop("test/CL"), ca), product(prop("test/CD"), sa)))
    axes = {
        "X": [product(qS, CX), prop("test/thrust-lbf")],
        "Y": [product(qS, derivatives("CY"))],
        "Z": [product(qS, CZ)],
        "ROLL": [product(qS, prop("metrics/bw-ft"), derivatives("Cl")), negative(load)],
        "PITCH": [
            product(
                qS,
                prop("metrics/cbarw-ft"),
                linear({alpha: aero.Cma, "test/q-hat": aero.Cmq, elevator: aero.Cmde}, aero.Cm0),
            ),
            negative(product(momentum, prop("velocities/r-rad_sec"))),
        ],
        "YAW": [product(qS, prop("metrics/bw-ft"), derivatives("Cn")), product(momentum, prop("velocities/q-rad_sec"))],
    }
    written = "".join(
        f'<axis name="{name}">'
        + "".join(function(f"test/force-{name}-{i}", part) for i, part in enumerate(parts))
        + "</axis>"
        for name, parts in axes.items()
    )
    origin = "<x>0</x><y>0</y><z>0</z>"
    declared = "".join(f'<property value="0">{name}</property>' for name in (elevator, aileron, rudder, "test/n"))
    return f"""<?xml version="1.0"?>
<fdm_config name="{aircraft.name}" version="2.0" release="BETA">
<metrics><wingarea unit="M2">{geometry.wing_area_m2!r}</wingarea><wingspan unit="M">{geometry.span_m!r}</wingspan>
<chord unit="M">{geometry.chord_m!r}</chord><location name="AERORP" unit="M">{origin}</location></metrics>
<mass_balance><ixx unit="KG*M2">{mass.Ix_kgm2!r}</ixx><iyy unit="KG*M2">{mass.Iy_kgm2!r}</iyy>
<izz unit="KG*M2">{mass.Iz_kgm2!r}</izz><emptywt unit="KG">{plant.mass_kg!r}</emptywt>
<location name="CG" unit="M">{origin}</location></mass_balance>
<ground_reactions/>
<flight_control name="none">{declared}</flight_control>
<aerodynamics>{"".join(functions)}{written}</aerodynamics>
</fdm_config>"""


def write(plant: Plant, folder: Path) -> str:
    """Write the definition where JSBSim looks for it; return the model's name."""
    name = plant.aircraft.name
    place = folder / "aircraft" / name
    place.mkdir(parents=True)
    (place / f"{name}.xml").write_text(definition(plant), "utf-8")
    return name
