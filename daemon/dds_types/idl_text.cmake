# Writes the IDL file as a C++ string, one literal per line: compilers need not accept literals of
# more than 65536 bytes.
file(READ ${IDL} text)
string(REGEX REPLACE "\n$" "" text "${text}")
string(REPLACE "\n" "\n)idl\"\nR\"idl(" text "${text}")
file(WRITE ${OUT} "#include <string_view>
namespace abbe::daemon {
std::string_view idl_text() noexcept {
  static constexpr char text[] =
R\"idl(${text}
)idl\";
  return {text, sizeof(text) - 1};
}
}  // namespace abbe::daemon
")
