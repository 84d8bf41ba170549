# Installs UNIT (a file of this folder) below the prefix of this installation, which
# `cmake --install --prefix` may choose: the unit starts the programs that are installed with it.
# Also given: BINDIR and DOCDIR, relative to the prefix or absolute. For the prefix "/" CMake sets an
# empty CMAKE_INSTALL_PREFIX.
get_filename_component(prefix "${CMAKE_INSTALL_PREFIX}/" ABSOLUTE)
get_filename_component(programs "${BINDIR}" ABSOLUTE BASE_DIR "${prefix}")
get_filename_component(documentation "${DOCDIR}" ABSOLUTE BASE_DIR "${prefix}")
get_filename_component(units lib/systemd/system ABSOLUTE BASE_DIR "${prefix}")

file(INSTALL "${CMAKE_CURRENT_LIST_DIR}/${UNIT}" DESTINATION "${units}")
set(installed "$ENV{DESTDIR}${units}/${UNIT}")
file(READ "${installed}" text)
string(REPLACE "ExecStart=/usr/bin/" "ExecStart=${programs}/" text "${text}")
string(REPLACE "file:///usr/share/doc/abbe/" "file://${documentation}/" text "${text}")
file(WRITE "${installed}" "${text}")
