# cmake -DNM=nm -DOBJECTS="a.o|b.o" -DREAL_TIME_PATH=REGEX -P forbidden_symbols.cmake
# Fails if an object file of the real-time path needs a symbol that allocates, locks, prints or throws. The path is
# every object file whose name matches.

set(forbidden
    "^_Zn[wa]"                    # operator new, operator new[]
    "^(malloc|calloc|realloc|aligned_alloc|posix_memalign)$"
    "^pthread_(mutex|cond|rwlock|spin)_" "^sem_" "^_ZNSt(3__1)?(mutex|18condition_variable)"
    "printf" "^_ZNSo" "^_ZSt4c(out|err|log)$" "^(puts|putchar|write|fwrite|syslog)$"
    "^__cxa_(throw|rethrow|allocate_exception|guard_acquire)" "^_ZSt[0-9]+__throw_")

string(REPLACE "|" ";" OBJECTS "${OBJECTS}")
string(REPLACE "/./" "/" OBJECTS "${OBJECTS}")
list(FILTER OBJECTS INCLUDE REGEX "${REAL_TIME_PATH}")
list(LENGTH OBJECTS count)
if(count EQUAL 0)
  message(FATAL_ERROR "no object file matches ${REAL_TIME_PATH}: the check would prove nothing")
endif()

set(found "")
foreach(object ${OBJECTS})
  execute_process(COMMAND ${NM} -u ${object} OUTPUT_VARIABLE undefined COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX MATCHALL "[^ \n]+\n" symbols "${undefined}")
  foreach(symbol ${symbols})
    string(STRIP "${symbol}" symbol)
    foreach(pattern ${forbidden})
      if(symbol MATCHES "${pattern}")
        string(APPEND found "\n  ${object}: ${symbol}")
      endif()
    endforeach()
  endforeach()
endforeach()
if(found)
  message(FATAL_ERROR "a real-time path needs:${found}")
endif()
message(STATUS "${count} object files of the real-time path name nothing forbidden")
