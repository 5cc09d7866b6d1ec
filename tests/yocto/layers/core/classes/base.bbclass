# What openembedded-core's base class makes of PACKAGECONFIG: flags for the build, and dependencies.
python () {
    chosen = (d.getVar("PACKAGECONFIG") or "").split()
    known = d.getVarFlags("PACKAGECONFIG") or {}
    for name in chosen:
        if name not in known:
            raise bb.parse.ParseError(f"PACKAGECONFIG {name} is nowhere described", d.getVar("FILE"))
        on, off, build, run = (known[name].split(",") + 4 * [""])[:4]
        d.appendVar("PACKAGECONFIG_CONFARGS", f" {on}")
        d.appendVar("DEPENDS", f" {build}")
        d.appendVar("RDEPENDS:" + d.getVar("PN"), f" {run}")
}
