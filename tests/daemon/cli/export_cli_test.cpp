/// `abbe export`, from a model to the files of a control.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "abbe/exports/export_format.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe_command.hpp"
#include "synthetic_model.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using test::Ran;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class CliExport : public ::testing::Test {
 protected:
  CliExport() {
    auto document = test::synthetic_document(3);
    test::write_text(folder_.path() / "model.json", to_json(document));
    document.model = test::synthetic_travel_model(3);
    test::write_text(folder_.path() / "travel.json", to_json(document));
  }
  [[nodiscard]] Ran abbe(const std::string& arguments) const {
    return test::run_abbe(folder_.path(), "export " + arguments);
  }
  [[nodiscard]] std::string file(const std::string& name) const {
    return test::text_of(folder_.path() / name);
  }
  [[nodiscard]] bool leaves_temporary_files() const {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_.path())) {
      if (entry.path().extension() == ".new") return true;
    }
    return false;
  }

  TemporaryFolder folder_;
};

TEST_F(CliExport, StatesSignHashAndLoss) {
  const auto ran = abbe("model.json --to siemens-lec -o comp.mpf");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto hash = model_hash(test::synthetic_document(3));
  EXPECT_THAT(ran.out, AllOf(HasSubstr("moves the axis in the negative direction"), HasSubstr(hash),
                             HasSubstr("1000 places"), HasSubstr("EAX"), HasSubstr("lost")));
  EXPECT_THAT(file("comp.mpf"), AllOf(HasSubstr("; abbe export of model " + hash),
                                      HasSubstr("$AA_ENC_COMP[0,0,X1]=")));
  EXPECT_FALSE(leaves_temporary_files());
}

TEST_F(CliExport, StatesTheValidityInTheFileAndWhereItIsNot) {
  const auto etalon = abbe("model.json --to etalon -o errors.txt");
  ASSERT_EQ(etalon.exit, 0) << etalon.err;
  EXPECT_THAT(etalon.out, HasSubstr("the validity volume, except as a comment"));
  EXPECT_THAT(file("errors.txt"), HasSubstr("valid for X "));
  const auto linuxcnc = abbe("model.json --to linuxcnc-comp -o compensation");
  ASSERT_EQ(linuxcnc.exit, 0) << linuxcnc.err;
  EXPECT_THAT(linuxcnc.out, HasSubstr("the validity volume: beyond the nodes"));
}

TEST_F(CliExport, WritesTheReportBesideFilesWithoutComments) {
  const auto ran = abbe("travel.json --to linuxcnc-comp -o compensation");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_EQ(file("compensation/export.txt"), ran.out);
  EXPECT_THAT(file("compensation/z.comp"), AllOf(Not(IsEmpty()), Not(HasSubstr("#"))));
}

constexpr const char* kLimit = "larger by 418 um/m";

/// Models of every state, in files and in a store.
class CliExportUse : public CliExport {
 protected:
  CliExportUse() {
    auto document = test::synthetic_document(3);
    document.verdict = ModelVerdict{.reasons = {kLimit}};
    test::write_text(folder_.path() / "refused.json", to_json(document));
    document.verdict.reset();
    test::write_text(folder_.path() / "earlier.json", to_json(document));
    id_ = store().add(document, false, {kLimit}, {"tester", "", {}}).value();
  }
  [[nodiscard]] ModelStore store() const {
    return ModelStore::open(folder_.path() / "store").value();
  }
  std::string id_;
};

TEST_F(CliExportUse, RefusesAModelThatTheGateRefused) {
  for (const std::string& model : {std::string{"refused.json"}, id_ + " --store store"}) {
    const auto ran = abbe(model + " --to siemens-lec -o comp.mpf");
    EXPECT_EQ(ran.exit, 5) << model;
    EXPECT_THAT(ran.err, AllOf(HasSubstr("refused by the gate"), HasSubstr(kLimit),
                               HasSubstr("--force"), HasSubstr("--why")));
    EXPECT_THAT(file("comp.mpf"), IsEmpty());
  }
}

TEST_F(CliExportUse, AForcedExportStatesItInEveryFileWithComments) {
  for (const FormatFacts* facts :
       {format_named("isg-csv"), format_named("etalon"), format_named("siemens-cec"),
        format_named("siemens-lec"), format_named("csv-grid"), format_named("linuxcnc-comp"),
        format_named("heidenhain-com")}) {
    const std::string name{facts->name};
    const auto ran = abbe("refused.json --to " + name + " -o out-" + name +
                          (facts->positive_moves == 0 ? " --positive plus" : "") +
                          " --force --reason 'trial on scrap parts'");
    ASSERT_EQ(ran.exit, 0) << name << ran.err;
    const auto stated = AllOf(HasSubstr("refused by the gate"), HasSubstr(kLimit),
                              HasSubstr("forced by"), HasSubstr("trial on scrap parts"));
    EXPECT_THAT(ran.out, stated) << name;
    EXPECT_THAT(ran.err, HasSubstr("caution: refused.json: verdict: refused")) << name;
    EXPECT_THAT(file("out-" + name + (facts->folder ? "/export.txt" : "")), stated) << name;
    EXPECT_EQ(facts->comments, !facts->folder);
  }
}

TEST_F(CliExportUse, ForceNeedsAReason) {
  const auto ran = abbe("refused.json --to siemens-lec -o comp.mpf --force");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, HasSubstr("--force needs --why"));
}

TEST_F(CliExportUse, AModelOfAnEarlierVersionIsExportedAndStatedAsNotJudged) {
  const auto ran = abbe("earlier.json --to csv-grid -o grid.csv");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.err, HasSubstr("caution: earlier.json: verdict: not judged"));
  EXPECT_THAT(file("grid.csv"), HasSubstr("# verdict: not judged"));
  ASSERT_EQ(abbe("model.json --to csv-grid -o grid.csv").exit, 0);
  EXPECT_THAT(file("grid.csv"), HasSubstr("# verdict: accepted by the gate"));
}

TEST_F(CliExportUse, AForcedActivationIsNoReasonToExport) {
  ASSERT_TRUE(store().activate(id_, {"foreman", "parts are waiting", {}}, true));
  const auto ran = abbe("active --store store --to siemens-lec -o comp.mpf");
  EXPECT_EQ(ran.exit, 5);
  EXPECT_THAT(ran.err,
              AllOf(HasSubstr("activated by force by foreman"), HasSubstr("parts are waiting")));
}

TEST_F(CliExportUse, RefusesAModelThatHasDrifted) {
  const auto good = store().add(test::synthetic_document(4), true, {}, {"tester", "", {}}).value();
  ASSERT_TRUE(store().activate(good, {"tester", "", {}}));
  ASSERT_EQ(abbe("active --store store --to siemens-lec -o comp.mpf").exit, 0);
  ASSERT_TRUE(store().add_drift(good, {"abbed", "EXX changed by 20 um", {}}));
  const auto ran = abbe("active --store store --to siemens-lec -o comp.mpf");
  EXPECT_EQ(ran.exit, 5);
  EXPECT_THAT(ran.err, HasSubstr("EXX changed by 20 um"));
}

TEST_F(CliExport, ReportsAsJson) {
  const auto ran = abbe("travel.json --to csv-grid --direction +,-,+ -o grid.csv --json");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto report = nlohmann::json::parse(ran.out);
  EXPECT_EQ(report["positive_moves"], 1);
  EXPECT_LE(report["largest_difference_nm"], 1.0);
  EXPECT_LT(report["rms_lost_um"][0], report["rms_without_um"][0]);
}

TEST_F(CliExport, AsksForASignThatIsNotDocumented) {
  const auto ran = abbe("model.json --to siemens-cec -o cec.mpf");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err,
              AllOf(HasSubstr("--positive plus or --positive minus"), HasSubstr("dial gauge")));
  const auto minus = abbe("model.json --to siemens-cec --positive minus -o minus.mpf");
  ASSERT_EQ(minus.exit, 0) << minus.err;
  ASSERT_EQ(abbe("model.json --to siemens-cec --positive plus -o plus.mpf").exit, 0);
  EXPECT_NE(file("minus.mpf"), file("plus.mpf"));
}

TEST_F(CliExport, RefusesWrongOptionsByName) {
  const auto message = [&](const std::string& options) {
    const auto ran = abbe("model.json -o out " + options);
    EXPECT_EQ(ran.exit, 2) << options;
    return ran.err;
  };
  EXPECT_THAT(message("--to fanuc"), HasSubstr("known: isg-csv, etalon"));
  EXPECT_THAT(message("--to siemens-lec --axis-map 'X=X1];M30'"), HasSubstr("--axis-map"));
  EXPECT_THAT(message("--to siemens-lec --axis-map X=Y1"), HasSubstr("must be different"));
  EXPECT_THAT(message("--to csv-grid --axis-map X=A"), HasSubstr("no names of axes"));
  EXPECT_THAT(message("--to linuxcnc-comp --positive plus"), HasSubstr("is fixed"));
  EXPECT_THAT(message("--to linuxcnc-comp --step-mm 1"), HasSubstr("601 nodes on axis X"));
  EXPECT_THAT(message("--to csv-grid --step-mm 0"), HasSubstr("must be positive"));
  EXPECT_THAT(message("--to csv-grid --step-mm nan"), HasSubstr("must be finite"));
  EXPECT_THAT(message("--to csv-grid --step-mm 0.5"), HasSubstr("nodes of the grid"));
  EXPECT_THAT(message("--to csv-grid --volume-mm=-300,300,-300,300,-400,0"),
              HasSubstr("Z -400 to 0 mm; the model is valid from -400 to -100 mm"));
  EXPECT_THAT(message("--to csv-grid --volume-mm 1,2,3"), HasSubstr("xmin,xmax,ymin"));
  EXPECT_THAT(message("--to isg-csv --direction +,+,+"), HasSubstr("is not a grid"));
}

TEST_F(CliExport, RefusesAModelOfWhichTheFormatHoldsNothing) {
  auto document = test::synthetic_document(3);
  auto description = document.model.description();
  for (auto& parameter : description.parameters) {
    // The straightness of X as a function of Z does not move X with X.
    if (parameter.name != "EXZ") parameter.value = 0.0;
    if (parameter.name == "EXZ") parameter.value = *parameter.position_m < -0.25 ? -5e-6 : 5e-6;
  }
  document.model = calib::VolumetricModel::from_description(std::move(description)).value();
  test::write_text(folder_.path() / "roll.json", to_json(document));
  const auto ran = abbe("roll.json --to linuxcnc-comp -o out");
  EXPECT_EQ(ran.exit, 1) << ran.out;
  EXPECT_THAT(ran.err, HasSubstr("linuxcnc-comp cannot hold this model"));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "out"));
}

TEST_F(CliExport, ReplacesNotTheModel) {
  const std::string before = file("model.json");
  std::filesystem::create_symlink("model.json", folder_.path() / "link.csv");
  for (const char* const out : {"model.json", "./model.json", "link.csv"}) {
    const auto ran = abbe(std::string{"model.json --to siemens-lec -o "} + out);
    EXPECT_EQ(ran.exit, 2) << out;
    EXPECT_THAT(ran.err, HasSubstr("this command reads this file"));
    EXPECT_EQ(file("model.json"), before) << out;
  }
}

TEST_F(CliExport, ReplacesNotTheModelByItsReport) {
  std::filesystem::create_directory(folder_.path() / "o");
  std::filesystem::copy_file(folder_.path() / "model.json", folder_.path() / "o/export.txt");
  const auto ran = abbe("o/export.txt --to linuxcnc-comp -o o");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, HasSubstr("write o/export.txt: this command reads this file"));
  EXPECT_EQ(file("o/export.txt"), file("model.json"));
}

TEST_F(CliExport, ReplacesNoDeviceAndNoFolder) {
  std::filesystem::create_directory(folder_.path() / "there");
  const auto ran = abbe("model.json --to siemens-lec -o there");
  EXPECT_EQ(ran.exit, 4);
  EXPECT_THAT(ran.err, HasSubstr("it exists and is not a file"));
  EXPECT_EQ(abbe("model.json --to siemens-lec -o /dev/null").exit, 4);
  EXPECT_THAT(abbe("model.json --to siemens-lec -o nowhere/x").err,
              HasSubstr("there is no folder nowhere"));
  EXPECT_THAT(abbe("model.json --to linuxcnc-comp -o model.json").err, HasSubstr("needs a folder"));
}

TEST_F(CliExport, RefusesAToolOfAnotherModel) {
  const auto ran = abbe("model.json --to siemens-lec --tool-mm 0,0,0 -o out");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, HasSubstr("tool offset (0, 0, 0) mm"));
}

}  // namespace
}  // namespace abbe::daemon
