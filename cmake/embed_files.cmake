# Writes the C++ source file OUT. Its function `std::span<const EmbeddedFile>
# abbe::NAMESPACE::FUNCTION() noexcept` returns the bytes of FILES ("NAME=PATH|NAME=PATH").
# EmbeddedFile has a name and bytes, and is declared in HEADER.
string(REPLACE "|" ";" FILES "${FILES}")
set(arrays "")
set(entries "")
set(i 0)
foreach(pair IN LISTS FILES)
  string(REGEX MATCH "^([^=]+)=(.+)$" matched "${pair}")
  set(name ${CMAKE_MATCH_1})
  file(READ ${CMAKE_MATCH_2} bytes HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
  string(APPEND arrays "constexpr unsigned char kFile${i}[] = {${bytes}};\n")
  string(APPEND entries "      {\"${name}\", {reinterpret_cast<const char*>(kFile${i}), sizeof(kFile${i})}},\n")
  math(EXPR i "${i} + 1")
endforeach()
file(WRITE ${OUT} "#include \"${HEADER}\"
namespace abbe::${NAMESPACE} {
namespace {
${arrays}}  // namespace
std::span<const EmbeddedFile> ${FUNCTION}() noexcept {
  static const EmbeddedFile files[] = {
${entries}  };
  return files;
}
}  // namespace abbe::${NAMESPACE}
")
