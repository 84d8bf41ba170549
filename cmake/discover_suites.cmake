# Asks the GoogleTest program PROGRAM for its test suites, and writes one ctest test for each suite
# to FILE, which ctest reads.
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE listed COMMAND_ERROR_IS_FATAL ANY TIMEOUT 60)
string(REGEX MATCHALL "(^|\n)[A-Za-z0-9_/]+[.]" suites "${listed}")
if(NOT suites)
  message(FATAL_ERROR "${PROGRAM} lists no tests")
endif()
set(tests "")
foreach(suite IN LISTS suites)
  string(REGEX REPLACE "[\n.]" "" suite "${suite}")
  string(APPEND tests "add_test([=[${MODULE}.${suite}]=] [=[${PROGRAM}]=] [=[--gtest_filter=${suite}.*]=] --gtest_brief=1)\n"
                      "set_tests_properties([=[${MODULE}.${suite}]=] PROPERTIES TIMEOUT 300 LABELS ${MODULE})\n")
endforeach()
file(WRITE ${FILE} "${tests}")
