# Writes the C++ source file OUT. Its function `std::string_view abbe::NAMESPACE::FUNCTION()
# noexcept` returns the bytes of FILE.
file(READ ${FILE} bytes HEX)
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
file(WRITE ${OUT} "#include <string_view>
namespace abbe::${NAMESPACE} {
std::string_view ${FUNCTION}() noexcept;
std::string_view ${FUNCTION}() noexcept {
  static constexpr unsigned char bytes[] = {${bytes}};
  return {reinterpret_cast<const char*>(bytes), sizeof(bytes)};
}
}  // namespace abbe::${NAMESPACE}
")
