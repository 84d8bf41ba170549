# Writes the C++ source file OUT. Its function `std::span<const EmbeddedText>
# abbe::NAMESPACE::FUNCTION() noexcept` returns the text files FILES ("NAME=PATH|NAME=PATH").
# EmbeddedText has a name and a text, and is declared in HEADER. The words of DROP ("WORD|WORD") are
# left out of the texts: folders of the source tree that precede the names of other files.
string(REPLACE "|" ";" FILES "${FILES}")
string(REPLACE "|" ";" DROP "${DROP}")
set(texts "")
foreach(pair IN LISTS FILES)
  string(REGEX MATCH "^([^=]+)=(.+)$" matched "${pair}")
  set(name ${CMAKE_MATCH_1})
  file(READ ${CMAKE_MATCH_2} text)
  foreach(word IN LISTS DROP)
    string(REPLACE "${word}" "" text "${text}")
  endforeach()
  string(APPEND texts "    {\"${name}\",\n     R\"text(${text})text\"},\n")
endforeach()
file(WRITE ${OUT} "#include \"${HEADER}\"
namespace abbe::${NAMESPACE} {
std::span<const EmbeddedText> ${FUNCTION}() noexcept {
  static constexpr EmbeddedText texts[] = {
${texts}  };
  return texts;
}
}  // namespace abbe::${NAMESPACE}
")
