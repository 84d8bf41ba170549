# Writes text files as `std::span<const EmbeddedText> abbe::NAMESPACE::FUNCTION() noexcept` into OUT. EmbeddedText has a name
# and a text, and is declared in HEADER. FILES: "NAME=PATH|NAME=PATH". In the text of each file, the words of DROP
# ("WORD|WORD") are left out: folders of the source tree, before names of other files.
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
