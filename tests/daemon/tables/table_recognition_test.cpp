/// Files that a spreadsheet or another program saved: the reader names what is unusual in them.

#include <gmock/gmock.h>

#include <filesystem>
#include <string>
#include <vector>

#include "abbe/tables/evemu_files.hpp"
#include "abbe/tables/input_files.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class TableRecognition : public ::testing::Test {
 protected:
  std::filesystem::path written(const std::string& text) {
    test::write_text(folder_.path() / "f.csv", text);
    return folder_.path() / "f.csv";
  }
  std::vector<std::string> points_faults(const std::string& text) {
    const auto points = read_points_csv(written(text));
    return points ? std::vector<std::string>{} : points.error().details;
  }
  std::vector<std::string> tracker_faults(const std::string& text) {
    const auto points = read_tracker_csv(written(text));
    return points ? std::vector<std::string>{} : points.error().details;
  }

  TemporaryFolder folder_;
};

TEST_F(TableRecognition, NamesSemicolons) {
  EXPECT_THAT(points_faults("x_mm;y_mm;z_mm\n1;2;3\n"),
              ElementsAre(AllOf(HasSubstr("f.csv:1:5: semicolons separate the values"),
                                HasSubstr("write commas"))));
}

TEST_F(TableRecognition, NamesTabs) {
  EXPECT_THAT(points_faults("x_mm\ty_mm\tz_mm\n1\t2\t3\n"),
              ElementsAre(HasSubstr("f.csv:1:5: tabs separate the values")));
}

TEST_F(TableRecognition, NamesSpaces) {
  EXPECT_THAT(points_faults("x_mm  y_mm z_mm\n1 2 3\n"),
              ElementsAre(HasSubstr("f.csv:1:5: spaces separate the values")));
}

TEST_F(TableRecognition, NamesDecimalCommasBetweenSemicolonsOnceWithTheirCount) {
  std::string text = "x_mm;y_mm;z_mm\n1;2;3\n";
  for (int i = 0; i < 412; ++i) text += "1,5;2;" + std::to_string(i) + "\n";
  EXPECT_THAT(points_faults(text),
              ElementsAre(HasSubstr("semicolons"),
                          AllOf(HasSubstr("f.csv:3:1: \"1,5\" has a decimal comma: write 0.5"),
                                HasSubstr(", and 411 more like this"))));
}

TEST_F(TableRecognition, NamesDecimalCommasBetweenCommas) {
  EXPECT_THAT(points_faults("x_mm,y_mm,z_mm\n1,2,3\n1,5,2,5,3,0\n"),
              ElementsAre(AllOf(HasSubstr("f.csv:3:12: 6 values, expected 3"),
                                HasSubstr("decimal separator, write 0.5, not 0,5"))));
}

TEST_F(TableRecognition, NamesDecimalCommasBesideWords) {
  const auto touches =
      read_touches_csv(written("position,kind,index,x_mm,y_mm,z_mm\n1,ball,1,0,5,1,5,2,5\n"));
  ASSERT_FALSE(touches);
  EXPECT_THAT(touches.error().details, ElementsAre(HasSubstr("decimal separator, write 0.5")));
}

TEST_F(TableRecognition, NamesAMissingHeaderAndItsColumns) {
  EXPECT_THAT(points_faults("# by hand\n1,2,3\n4,5,6\n"),
              ElementsAre(AllOf(HasSubstr("f.csv:2:1: the header line is missing"),
                                HasSubstr("before this one: x_mm,y_mm,z_mm"))));
}

TEST_F(TableRecognition, NamesOnlyTheMissingHeaderIfSpacesFollowTheCommas) {
  for (const char* row : {"0, 0, 0\n", "12, 0, 0.5\n"})
    EXPECT_THAT(points_faults(row), ElementsAre(HasSubstr("the header line is missing"))) << row;
}

TEST_F(TableRecognition, NamesTheHeadersOfAsManyColumns) {
  EXPECT_THAT(tracker_faults("0,2000,0.1,0.2\n"),
              ElementsAre(HasSubstr("before this one: time_s,range_mm,azimuth_rad,elevation_rad"
                                    "  or  time_s,tracker_x_mm,tracker_y_mm,tracker_z_mm"
                                    "  or  time_s,x_mm,y_mm,z_mm")));
}

TEST_F(TableRecognition, NamesSemicolonsAndDecimalCommasAlsoWithoutAHeader) {
  EXPECT_THAT(points_faults("1,5;2;3\n1,5;2;3\n"),
              ElementsAre(HasSubstr(":1:1: the header line is missing"),
                          HasSubstr(":1:4: semicolons"), HasSubstr(":1:1: \"1,5\" has a decimal"),
                          HasSubstr(":2:1: \"1,5\" has a decimal")));
}

TEST_F(TableRecognition, NamesQuotationMarks) {
  EXPECT_THAT(points_faults("\"x_mm\",\"y_mm\",\"z_mm\"\n1,2,3\n"),
              ElementsAre(HasSubstr("f.csv:1:1: quotation marks around values")));
  EXPECT_THAT(points_faults("x_mm,y_mm,z_mm\n1,\"2,5\",3\n"),
              ElementsAre(HasSubstr("f.csv:2:3: quotation marks around values")));
}

TEST_F(TableRecognition, NamesSeparatorsOfSingleRows) {
  EXPECT_THAT(points_faults("x_mm,y_mm,z_mm\n1,2,3\n1;2;3\n 1\t2\t3\n"),
              ElementsAre(HasSubstr("f.csv:3:2: semicolons"), HasSubstr("f.csv:4:3: tabs")));
}

TEST_F(TableRecognition, NamesUtf16AndSpreadsheetFiles) {
  EXPECT_THAT(points_faults(std::string("\xFF\xFEx\0_\0", 6)), ElementsAre(HasSubstr("UTF-16")));
  EXPECT_THAT(points_faults("PK\x03\x04rest"), ElementsAre(HasSubstr(".xlsx")));
}

TEST_F(TableRecognition, AcceptsAByteOrderMarkAndCarriageReturns) {
  const auto points = read_points_csv(written("\xEF\xBB\xBFx_mm,y_mm,z_mm\r\n1,2,3\r\n"));
  ASSERT_TRUE(points) << points.error().details.front();
  EXPECT_THAT(points->points_m, ElementsAre(AxisPosition{0.001, 0.002, 0.003}));
}

}  // namespace
}  // namespace abbe::daemon
