/// Cells that look right but are not: error values of spreadsheets, numbers of other notations,
/// characters that are not visible.

#include <gmock/gmock.h>

#include <filesystem>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tables/measured_file.hpp"
#include "abbe_command.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using namespace std::string_literals;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

class StrangeCells : public ::testing::Test {
 protected:
  std::vector<std::string> faults(const std::string& text) {
    test::write_text(folder_.path() / "f.csv", text);
    const auto points = read_points_csv(folder_.path() / "f.csv");
    return points ? std::vector<std::string>{} : points.error().details;
  }
  std::vector<std::string> faults_of_cell(const std::string& cell) {
    return faults("x_mm,y_mm,z_mm\n1,2,3\n" + cell + ",5,6\n");
  }

  TemporaryFolder folder_;
};

TEST_F(StrangeCells, AnErrorValueOfASpreadsheetIsNotAComment) {
  for (const std::string cell : {"#N/A", "#NV", "#REF!", "#DIV/0!", "#VALUE!", "#NAME?", "#NUM!",
                                 "#NULL!", "#WERT!", "#BEZUG!", "  #SPILL!", "########"})
    EXPECT_THAT(faults_of_cell(cell),
                ElementsAre(AllOf(HasSubstr("f.csv:3:"), HasSubstr("x_mm: \"#"),
                                  HasSubstr("an error value of a spreadsheet"))))
        << cell;
}

TEST_F(StrangeCells, AnErrorValueIsNamedInEveryColumn) {
  EXPECT_THAT(faults("x_mm,y_mm,z_mm\n1,#N/A,3\n"),
              ElementsAre(AllOf(StartsWith((folder_.path() / "f.csv").string() + ":2:3: y_mm"),
                                HasSubstr("error value of a spreadsheet"))));
}

TEST_F(StrangeCells, CommentsOfPeopleAreSkipped) {
  for (const std::string comment :
       {"# measured by Ann", "#measured by Ann, at 20 C", "#", "####", "#### warm ####",
        "#Achtung!, warm", "#1,2,3", "# N/A, because the beam was lost", "#x_mm,y_mm,z_mm"})
    EXPECT_THAT(faults(comment + "\nx_mm,y_mm,z_mm\n" + comment + "\n1,2,3\n"), IsEmpty())
        << comment;
}

TEST_F(StrangeCells, NumbersOfOtherNotationsAreRefused) {
  for (const std::string cell : {"+-100", "0x10", "1e", "1_000", "0x1p3", "inf", "nan"})
    EXPECT_THAT(faults_of_cell(cell), ElementsAre(HasSubstr("x_mm: \"" + cell + "\": "))) << cell;
}

TEST_F(StrangeCells, CharactersThatAreNotVisibleAreNamed) {
  for (const auto& [cell, shown, named] :
       {std::tuple{"\xe2\x88\x92"
                   "4"s,
                   "\xe2\x88\x92"
                   "4",
                   "U+2212 (minus sign): write \"-\""},
        {"1\xc2\xa0"
         "000"s,
         "1\\u{A0}000", "U+00A0 (no-break space): delete it"},
        {"\xe2\x80\x8b"
         "4"s,
         "\\u{200B}4", "U+200B, which is not visible: delete it"},
        {"\x0b"
         "4"s,
         "\\u{B}4", "U+000B (control character)"},
        {"\x1b[31m4"s, "\\u{1B}[31m4", "U+001B (control character)"},
        {"4\0"s, "4\\u{0}", "U+0000 (control character)"}})
    EXPECT_THAT(faults_of_cell(cell), ElementsAre(AllOf(HasSubstr(shown), HasSubstr(named))));
}

TEST_F(StrangeCells, ASecondByteOrderMarkIsNamed) {
  const std::string bom = "\xef\xbb\xbf", table = "x_mm,y_mm,z_mm\n1,2,3\n";
  EXPECT_THAT(faults(bom + table), IsEmpty());
  EXPECT_THAT(faults(bom + bom + table), ElementsAre(HasSubstr("two byte order marks (U+FEFF)")));
  EXPECT_THAT(faults("x_mm,y_mm," + bom + "z_mm\n1,2,3\n"),
              ::testing::Contains(AllOf(HasSubstr("\\u{FEFF}z_mm: unknown column"),
                                        HasSubstr("U+FEFF (byte order mark): delete it"))));
}

TEST_F(StrangeCells, AControlCharacterNeverReachesTheTerminal) {
  test::write_text(folder_.path() / "p.csv", "x_mm,y_mm,z_mm\n\x1b[31m4,5,6\n");
  test::write_text(folder_.path() / "m.toml", "[machine]\nname = \"a\\u001b[31m\"\n");
  for (const std::string arguments :
       {"identify otf --machine m.toml --path p.csv --tracker p.csv -o o", "replay '\x1b[31m.mcap'",
        "model eval '\x1b]0;x\x07.json' --points p.csv", "status --socket '\x1b[31m'"}) {
    const auto ran = test::run_abbe(folder_.path(), arguments);
    EXPECT_NE(ran.exit, 0) << arguments;
    EXPECT_THAT(ran.out + ran.err, Not(HasSubstr("\x1b"))) << arguments;
    EXPECT_THAT(ran.err, AnyOf(HasSubstr("\\u{1B}"), HasSubstr("U+001B"))) << arguments;
  }
}

TEST(Configuration, RefusesNamesWithControlCharacters) {
  const auto parsed = parse_config("[machine]\nname = \"a\\u001b[31m\"\n", "abbed.toml");
  ASSERT_FALSE(parsed);
  EXPECT_THAT(
      parsed.error().details,
      ::testing::Contains(AllOf(HasSubstr("abbed.toml:2:8: machine.name: contains U+001B"))));
}

}  // namespace
}  // namespace abbe::daemon
