/// `abbe model compare MODEL --measured FILE`, the built program: files of a direct device as they
/// should be, and with the mistakes that people make.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "abbe/tables/measured_file.hpp"
#include "abbe_command.hpp"
#include "faults_text.hpp"
#include "synthetic_model.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using test::Ran;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

struct MeasuredRow {
  std::string name;
  double position_mm, value, run;
  std::string unit, direction;
};

using ChangeRow = std::function<void(MeasuredRow&)>;

class MeasuredCli : public ::testing::Test {
 protected:
  MeasuredCli() { test::write_text(folder_.path() / "model.json", to_json(document_)); }

  /// Linear between the nodes of the model.
  [[nodiscard]] double table(const std::string& name, double position_mm) const {
    const auto parameters = document_.model.parameters();
    for (std::size_t i = 0; i + 1 < parameters.size(); ++i) {
      const auto &a = parameters[i], &b = parameters[i + 1];
      if (a.name != name || b.name != name) continue;
      const double from = 1e3 * *a.position_m, to = 1e3 * *b.position_m;
      const double u = (position_mm - from) / (to - from);
      if (u > -1e-9 && u < 1.0 + 1e-9) return 1e6 * ((1.0 - u) * a.value + u * b.value);
    }
    return 0.0;
  }

  [[nodiscard]] std::vector<MeasuredRow> rows(int runs = 5) const {
    std::vector<MeasuredRow> all;
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    for (const std::string name : {"EXX", "EYX", "EBX"})
      for (int run = 1; run <= runs; ++run)
        for (const char* direction : {"+", "-"})
          for (int p = -300; p <= 300; p += 50)
            all.push_back({name, static_cast<double>(p), table(name, p) + 0.3 * normal(random),
                           static_cast<double>(run), name[1] == 'B' ? "urad" : "um", direction});
    return all;
  }

  void write_rows(const std::vector<MeasuredRow>& all) const {
    std::string text = "name,position_mm,value,unit,run,direction\n";
    for (const auto& r : all)
      text += fmt::format("{},{},{:.4f},{},{},{}\n", r.name, r.position_mm, r.value, r.unit, r.run,
                          r.direction);
    write(text);
  }
  void write(const std::string& text) const {
    test::write_text(folder_.path() / "measured.csv", text);
  }
  [[nodiscard]] Ran compare(const std::string& options = {}) const {
    return test::run_abbe(folder_.path(),
                          "model compare model.json --measured measured.csv " + options);
  }
  [[nodiscard]] Ran compare_changed(const ChangeRow& change, int runs = 5) const {
    auto all = rows(runs);
    for (auto& row : all) change(row);
    write_rows(all);
    return compare();
  }

  TemporaryFolder folder_;
  ModelDocument document_ = test::synthetic_document(1);
};

TEST_F(MeasuredCli, AgreesWithItsOwnTables) {
  write_rows(rows());
  const auto ran = compare("--json");
  ASSERT_EQ(ran.exit, 0) << ran.err << ran.out;
  const auto object = nlohmann::json::parse(ran.out);
  ASSERT_EQ(object["tables"].size(), 3u);
  for (const auto& table : object["tables"]) {
    EXPECT_EQ(table["verdict"], "agrees");
    EXPECT_EQ(table["points"].size(), 13u);
    EXPECT_LT(table["mae"].get<double>(), 1.0);
  }
  EXPECT_EQ(object["volume"]["compared"], nlohmann::json({"EXX", "EYX", "EBX"}));
  EXPECT_LT(object["volume"]["as_stated"]["mean_um"].get<double>(), 1.0);
}

TEST_F(MeasuredCli, PrintsTablesConventionsAndVolume) {
  write_rows(rows());
  EXPECT_THAT(
      compare().out,
      AllOf(HasSubstr("EXX    agrees"), HasSubstr("X: zero at 0 mm  (EXX, EBX)"),
            HasSubstr("line through -300 and 300 mm removed  (EYX)"), HasSubstr("no columns x_mm"),
            HasSubstr("difference without rigid motion"), HasSubstr("(not measured)"),
            HasSubstr("reveals"), HasSubstr("tool offset of the model: (")));
  EXPECT_THAT(compare("--straightness least-squares").out, HasSubstr("least-squares line"));
}

TEST_F(MeasuredCli, NamesTheLineOfAValueThatAloneDoesNotFit) {
  auto all = rows();
  all[7].value = -9999.0;
  all[200].value = 1e30;
  write_rows(all);
  const auto ran = compare();
  EXPECT_EQ(ran.exit, 1);  // EBX agrees
  EXPECT_THAT(ran.out, AllOf(HasSubstr("measured.csv:9: EXX alone does not fit"),
                             HasSubstr("measured.csv:202: EYX alone does not fit")));
  const auto object = nlohmann::json::parse(compare("--json").out);
  EXPECT_EQ(object["rows_off"].size(), 2u);
  write_rows(rows());
  EXPECT_EQ(nlohmann::json::parse(compare("--json").out)["rows_off"].size(), 0u);
}

TEST_F(MeasuredCli, NamesTheNumberingOfBidirectionalRuns) {
  const auto ran =
      compare_changed([](MeasuredRow& r) { r.run = 2 * r.run - (r.direction == "+" ? 1 : 0); });
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, HasSubstr("(1, 1, 2, 2, ...)"));
}

TEST_F(MeasuredCli, PrintsJsonAlsoForAFileNameInLatin1) {
  write_rows(rows());
  const std::string name = "m\xfc.csv";
  std::filesystem::copy_file(folder_.path() / "measured.csv", folder_.path() / name);
  const auto ran =
      test::run_abbe(folder_.path(), "model compare model.json --measured '" + name + "' --json");
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_EQ(nlohmann::json::parse(ran.out)["measured"], "m\xef\xbf\xbd.csv");
}

TEST_F(MeasuredCli, NamesAReversedSign) {
  const auto ran = compare_changed([](MeasuredRow& r) { r.value = -r.value; });
  EXPECT_EQ(ran.exit, 5);
  EXPECT_THAT(ran.out, HasSubstr("with the sign of the values reversed"));
}

TEST_F(MeasuredCli, NamesReversedPositions) {
  const auto ran = compare_changed([](MeasuredRow& r) { r.position_mm = -r.position_mm; });
  EXPECT_EQ(ran.exit, 5);
  EXPECT_THAT(ran.out, HasSubstr("with the sign of the positions reversed"));
}

TEST_F(MeasuredCli, NamesAnOffsetOfThePositions) {
  const auto ran = compare_changed([](MeasuredRow& r) { r.position_mm += 30.0; });
  EXPECT_EQ(ran.exit, 5);
  EXPECT_THAT(ran.out, AllOf(HasSubstr(" mm added to the positions"),
                             HasSubstr("1 positions left out: outside the nodes")));
}

TEST_F(MeasuredCli, ReportsOneDirectionAndATooSmallRange) {
  auto all = rows();
  std::erase_if(all, [](const MeasuredRow& r) {
    return r.direction == "-" || (r.name == "EBX" && std::abs(r.position_mm) > 60.0 &&
                                  r.position_mm < 600.0 && r.position_mm != 300.0);
  });
  for (auto& row : all)
    if (row.name == "EBX") row.position_mm += 260.0;
  write_rows(all);
  EXPECT_THAT(compare().out,
              AllOf(HasSubstr("EXX: one direction of travel only: the values contain half of the "
                              "backlash"),
                    HasSubstr("left out of both: EBX (too few common positions)")));
}

TEST_F(MeasuredCli, DoesNotCompareASquarenessOfUnknownPlace) {
  write("name,position_mm,value,unit,run,direction\nC0Y,,12,urad,1,\nC0Y,,12.4,urad,2,\n");
  const auto ran = compare();
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.out, AllOf(HasSubstr("not compared"), HasSubstr("is not stated (x_mm")));
}

TEST_F(MeasuredCli, IgnoresAnOffsetOfTheValues) {
  EXPECT_EQ(compare_changed([](MeasuredRow& r) { r.value += 500.0 + r.run; }).exit, 0);
}

TEST_F(MeasuredCli, DoesNotTestOneRun) {
  const auto ran = compare_changed([](MeasuredRow&) {}, 1);
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.out, AllOf(HasSubstr("not tested"), HasSubstr("one run shows no scatter"),
                             HasSubstr("no table was tested")));
  EXPECT_EQ(nlohmann::json::parse(compare("--json").out)["tables_tested"], 0);
  EXPECT_THAT(compare("--u-um 1 --u-urad 1").out,
              AllOf(HasSubstr("agrees"), Not(HasSubstr("not tested"))));
}

TEST_F(MeasuredCli, StatesRangesWithoutOverlap) {
  const auto ran = compare_changed([](MeasuredRow& r) { r.position_mm += 1000.0; });
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.out, HasSubstr("from 700 to 1300 mm, the model covers -300 to 300 mm"));
}

TEST_F(MeasuredCli, RefusesACopiedRun) {
  auto all = rows(2);
  for (std::size_t i = 0; i < 26; ++i) {
    all.push_back(all[i]);
    all.back().run = 3;
  }
  write_rows(all);
  const auto ran = compare();
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, HasSubstr("measured.csv: EXX: run 3 has exactly the values of run 1"));
}

TEST_F(MeasuredCli, RefusesOtherCombinationsOfArguments) {
  EXPECT_EQ(test::run_abbe(folder_.path(), "model compare model.json").exit, 2);
  EXPECT_NE(
      test::run_abbe(folder_.path(), "model compare model.json model.json --measured measured.csv")
          .exit,
      0);
  EXPECT_EQ(compare().exit, 4) << "no file";
}

class MeasuredCsv : public MeasuredCli {
 protected:
  [[nodiscard]] std::string faults(
      const std::string& lines,
      const std::string& header = "name,position_mm,value,unit,run,direction\n") const {
    write(header + lines);
    return test::faults_text(read_measured_csv(folder_.path() / "measured.csv"));
  }
};

TEST_F(MeasuredCsv, ReadsErrorsWithTheirLines) {
  write(
      "name,position_mm,value,unit,run,direction,x_mm,y_mm,z_mm\n"
      "EXX,-300,1.5,um,1,+,,20,-200\nC0Y,,12,urad,2,,100,0,-50\nEXX,0,2.5,um,1,-,0,20,-200\n");
  const auto file = read_measured_csv(folder_.path() / "measured.csv");
  ASSERT_TRUE(file) << test::faults_text(file);
  ASSERT_EQ(file->errors.size(), 2u);
  const auto& EXX = file->errors[0];
  ASSERT_EQ(EXX.readings.size(), 2u);
  EXPECT_DOUBLE_EQ(EXX.readings[1].value, 2.5e-6);
  EXPECT_FALSE(EXX.readings[1].forward);
  EXPECT_EQ(*EXX.line_m, calib::Vector3(0.0, 0.02, -0.2));
  EXPECT_EQ(file->errors[1].name, "EC0Y");
  EXPECT_EQ(file->errors[1].line_m, calib::Vector3(0.1, 0.0, -0.05));
}

TEST_F(MeasuredCsv, NamesEveryFaultWithItsLine) {
  const auto text = faults(
      "EXX,0,1,urad,1,+\nEAX,0,1,um,1,+\nEXX,,1,um,1,+\nEXX,0,1,um,1,\n"
      "EXX,0,1,um,1.5,+\nEXW,0,1,um,1,+\nEXX,0,1,mm,1,+\nEXX,0,1,um,1,forward\n");
  for (const char* fault :
       {":2:1: unit: urad for a length: needs um", ":3:1: unit: um for an angle: needs urad",
        ":4:1: position_mm: empty", ":5:1: direction: empty: needs + or -",
        ":6:1: run: 1.5: must be a whole number", ":7:1: name: \"EXW\": unknown",
        ":8:9: unit: \"mm\": must be um or urad", ":9:14: direction: \"forward\": must be + or -"})
    EXPECT_THAT(text, HasSubstr(fault));
}

TEST_F(MeasuredCsv, NamesAMissingColumn) {
  EXPECT_THAT(faults("EXX,0,1,um,1\n", "name,position_mm,value,unit,run\n"),
              HasSubstr("direction: missing column"));
}

TEST_F(MeasuredCsv, NamesDecimalCommas) {
  EXPECT_THAT(faults("EXX,0,1,5,um,1,+\n"), HasSubstr("decimal"));
  EXPECT_THAT(faults("EXX;0;1,5;um;1;+\n", "name;position_mm;value;unit;run;direction\n"),
              HasSubstr("semicolons"));
}

TEST_F(MeasuredCsv, NamesARepeatedRun) {
  EXPECT_THAT(
      faults("EXX,0,1,um,1,+\nEXX,100,1,um,1,+\nEXX,0.001,1.1,um,1,+\n"),
      HasSubstr(":4:1: run: EXX has a value for run 1, this direction and position in line 2"));
}

TEST_F(MeasuredCsv, NamesAMeasuredLineThatChanges) {
  const std::string header = "name,position_mm,value,unit,run,direction,x_mm,y_mm,z_mm\n";
  EXPECT_THAT(faults("EXX,0,1,um,1,+,,20,\n", header), HasSubstr("one axis of the measured line"));
  EXPECT_THAT(faults("C0Y,,1,urad,1,,10,20,\n", header), HasSubstr("needs x, y and z"));
  EXPECT_THAT(faults("EXX,0,1,um,1,+,,20,0\nEXX,1,1,um,1,+,,25,0\n", header),
              HasSubstr(":3:1: x_mm: another measured line"));
}

}  // namespace
}  // namespace abbe::daemon
