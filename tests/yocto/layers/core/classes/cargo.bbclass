# Stands in for the class of this name, which builds beside the sources.
B = "${WORKDIR}/build"
