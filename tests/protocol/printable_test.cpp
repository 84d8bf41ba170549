#include "abbe/protocol/printable.hpp"

#include <gtest/gtest.h>

#include <string>

namespace abbe::protocol {
namespace {

using namespace std::string_literals;

TEST(Printable, LeavesTextInAnyLanguage) {
  for (const std::string text : {"mill 1", "Fräse é 機械 Ω −5 µm", "two\nlines", ""})
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, EscapesWhatATerminalTakesForACommand) {
  EXPECT_EQ(printable("a\x1b[31mb"), "a\\u{1B}[31mb");
  EXPECT_EQ(printable("\0\t\r\x7f\x0b"s), "\\u{0}\\u{9}\\u{D}\\u{7F}\\u{B}");
  EXPECT_EQ(printable("\xc2\x9b"), "\\u{9B}");  // CSI in one character
}

TEST(Printable, EscapesWhatIsNotVisible) {
  EXPECT_EQ(printable("\xe2\x80\x8b"), "\\u{200B}");
  EXPECT_EQ(printable("1\xc2\xa0"
                      "000"),
            "1\\u{A0}000");
  EXPECT_EQ(printable("\xef\xbb\xbfx_mm"), "\\u{FEFF}x_mm");
  EXPECT_EQ(printable("\xe2\x80\xae"), "\\u{202E}");  // right-to-left override
}

TEST(Printable, EscapesBytesThatAreNotUtf8) {
  EXPECT_EQ(printable("m\xfc.csv"), "m\\xFC.csv");
  EXPECT_EQ(printable("\xe2\x88"), "\\xE2\\x88");           // cut off
  EXPECT_EQ(printable("\xc0\xaf"), "\\xC0\\xAF");           // not the shortest form
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xED\\xA0\\x80");  // a surrogate
}

TEST(Printable, TwiceChangesNothingMore) {
  for (int code = 0; code < 256; ++code) {
    const std::string once = printable("a" + std::string(1, static_cast<char>(code)) + "b");
    EXPECT_EQ(printable(once), once);
  }
}

TEST(PrintableLine, EscapesNewlinesToo) {
  EXPECT_EQ(printable_line("a\nb"), "a\\u{A}b");
}

TEST(WithoutControlCharacters, KeepsInvisibleOnes) {
  EXPECT_EQ(without_control_characters("a\xc2\xa0\x1b\n\xfc"), "a\xc2\xa0\\u{1B}\n\xfc");
}

TEST(StrangeCharacter, IsNamedWithWhatToDo) {
  EXPECT_EQ(strange_character("-1.5"), "");
  EXPECT_EQ(strange_character("\xe2\x88\x92"
                              "5"),
            "U+2212 (minus sign): write \"-\"");
  EXPECT_EQ(strange_character("1\xc2\xa0"
                              "000"),
            "U+00A0 (no-break space): delete it");
  EXPECT_EQ(strange_character("\xe2\x80\x8b"), "U+200B, which is not visible: delete it");
  EXPECT_EQ(strange_character("\x0b"
                              "5"),
            "U+000B (control character): delete it");
  EXPECT_EQ(strange_character("\xfc"), "byte 0xFC, which is not UTF-8");
}

}  // namespace
}  // namespace abbe::protocol
