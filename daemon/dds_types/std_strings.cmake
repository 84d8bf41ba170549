# fastddsgen makes fixed_string<N> of string<N>: a Fast DDS header in everybody's include path, and silent truncation of
# what is too long. With std::string the types need Fast CDR only, and encode() can see and refuse what is too long.
foreach(file ${HEADER} ${SOURCE})
  file(READ ${file} text)
  string(REPLACE "#include <fastrtps/utils/fixed_size_string.hpp>\n" "" text "${text}")
  string(REGEX REPLACE "eprosima::fastrtps::fixed_string<[0-9]+>" "std::string" text "${text}")
  file(WRITE ${file} "${text}")
endforeach()
