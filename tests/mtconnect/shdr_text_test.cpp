#include "abbe/mtconnect/shdr_text.hpp"

#include <gmock/gmock.h>

#include "shdr_client.hpp"

namespace abbe::mtconnect {
namespace {

using ::testing::ElementsAre;

/// The field between two others, as an agent reads it.
std::string read_back(std::string_view text) {
  const auto fields = test::shdr_fields("a|" + shdr_field(text) + "|b");
  EXPECT_EQ(fields.size(), 3u) << text;
  EXPECT_EQ(fields.back(), "b") << text;
  return fields.at(1);
}

TEST(ShdrText, IsReadBackAsItWas) {
  for (const char* text :
       {"tracker 10.0.0.7:700: no reply", "a|b", "|", "a|b|", "\"quoted\"", "\"", "say \"a|b\"",
        "C:\\data", "C:\\|D:\\", "\\", "|\\\"|", "\xC3\xBC\xE2\x82\xAC\xF0\x9F\x94\xA7", ""})
    EXPECT_EQ(read_back(text), text);
}

/// The example of the documentation of cppagent.
TEST(ShdrText, EscapesAPipeAsDocumented) {
  EXPECT_EQ(shdr_field("a|b"), R"("a\|b")");
}

/// cppagent 2.2.0.17 was seen to show nothing after a line with this word.
TEST(ShdrText, BeginsNoDocumentInSeveralLines) {
  const std::string word = "--multiline--";
  for (const std::string& text : {word, "a " + word + " b", word + "multiline--",
                                  "-" + word + "|" + word, "\"" + word + "0FED"}) {
    EXPECT_EQ(shdr_field(text).find(word), std::string::npos) << text;
    EXPECT_EQ(read_back(text), text);
  }
  EXPECT_EQ(shdr_code(word).find(word), std::string::npos);
}

TEST(ShdrText, IsNotQuotedWithoutNeed) {
  EXPECT_EQ(shdr_field("C:\\data \"x\""), "C:\\data \"x\"");
}

TEST(ShdrText, HasNoLineBreakAndNoControlCharacter) {
  EXPECT_EQ(shdr_field("one\r\ntwo\tthree\x01\x7F.\n"), "one  two three  .");
  EXPECT_EQ(shdr_field(std::string_view("a\0b", 3)), "a b");
}

TEST(ShdrText, HasNoBytesThatAreNotUtf8) {
  EXPECT_EQ(shdr_field("a\xFF"
                       "b\xC3"),
            "a?b?");
  EXPECT_EQ(shdr_field("\xED\xA0\x80"), "???") << "a surrogate";
  EXPECT_EQ(shdr_field("\xC0\xAF"), "??") << "overlong";
}

TEST(ShdrText, IsCutBetweenTwoCharacters) {
  std::string text(kLongestText - 1, 'x');
  EXPECT_EQ(shdr_field(text + "\xC3\xBC"), text);
  EXPECT_EQ(shdr_field(text + "yz"), text + "y");
}

TEST(ShdrText, HasNativeCodesThatTheAgentDoesNotSplit) {
  EXPECT_EQ(shdr_code("plate:1|2"), R"("plate_1\|2")");
}

TEST(ShdrText, DatesInUtcWithMicroseconds) {
  const protocol::UtcTime time{std::chrono::nanoseconds{1'715'934'600'123'456'789}};
  EXPECT_EQ(shdr_time(time), "2024-05-17T08:30:00.123456Z");
}

TEST(ShdrText, OfTheTestsReaderFollowsTheDocumentation) {
  EXPECT_THAT(test::shdr_fields(R"(y|"a\|b\|"|z)"), ElementsAre("y", "a|b|", "z"));
  EXPECT_THAT(test::shdr_fields("x|y||z|"), ElementsAre("x", "y", "", "z", ""));
}

}  // namespace
}  // namespace abbe::mtconnect
