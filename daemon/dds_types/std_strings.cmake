# Replaces fixed_string<N>, which fastddsgen generates for string<N>, by std::string. fixed_string
# needs a header of Fast DDS in every include path and silently truncates longer text. With
# std::string the types need Fast CDR only, and encode() can detect and refuse longer text.
foreach(file ${HEADER} ${SOURCE})
  file(READ ${file} text)
  string(REPLACE "#include <fastrtps/utils/fixed_size_string.hpp>\n" "" text "${text}")
  string(REGEX REPLACE "eprosima::fastrtps::fixed_string<[0-9]+>" "std::string" text "${text}")
  file(WRITE ${file} "${text}")
endforeach()
