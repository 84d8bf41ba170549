/// `abbe report`: the built program on a store, its files, output and exit codes.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdlib>
#include <regex>

#include "abbe/model/model_store.hpp"
#include "abbe_command.hpp"
#include "synthetic_model.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class ReportCli : public ::testing::Test {
 protected:
  void SetUp() override {
    auto store = ModelStore::open(folder_ / "store").value();
    const StoreActor actor{"turner", "spring", {}};
    first_ = store.add(test::synthetic_document(1), true, {}, actor).value();
    second_ = store.add(test::synthetic_document(2), false, {"no better"}, actor).value();
    ASSERT_TRUE(store.activate(first_, {"foreman", "", {}}));
  }
  [[nodiscard]] test::Ran report(const std::string& arguments) const {
    return test::run_abbe(folder_, "report " + arguments + " --store store");
  }
  [[nodiscard]] std::string file(const std::string& name) const {
    return test::text_of(folder_ / name);
  }
  /// details.toml: the example with dates on days 15 and 16 of a month.
  void write_details(const std::string& month) const {
    std::string text = test::run_abbe(folder_, "example certificate.toml").out;
    text = std::regex_replace(text, std::regex("2026-11-2([56])"), month + "-1$1");
    test::write_text(folder_ / "details.toml", text);
  }

  TemporaryFolder temporary_;
  const fs::path& folder_ = temporary_.path();
  std::string first_, second_;
};

TEST_F(ReportCli, WritesTheReportOfAStoredModelAgain) {
  const auto ran = report("active");
  EXPECT_EQ(ran.exit, 0) << ran.err;
  const std::string name = fmt::format("report-{}.html", first_);
  EXPECT_THAT(ran.out, HasSubstr(name));
  EXPECT_THAT(file(name), AllOf(HasSubstr("Green: the gate accepted"), HasSubstr("turner"),
                                HasSubstr("activated by foreman")));
  EXPECT_EQ(report(first_.substr(0, 6) + " -o again.html").exit, 0);
  EXPECT_EQ(file(name), file("again.html"));
  EXPECT_EQ(report(second_ + " -o refused.html").exit, 0);
  EXPECT_THAT(file("refused.html"),
              AllOf(HasSubstr("Red: the gate refused"), HasSubstr("no better")));
}

TEST_F(ReportCli, ComparesTwoModelsAndShowsTheTrend) {
  EXPECT_EQ(report(first_ + " --compare " + second_ + " -o c.html").exit, 0);
  EXPECT_THAT(file("c.html"), AllOf(HasSubstr(first_), HasSubstr(second_), HasSubstr("B - A")));
  EXPECT_EQ(report(first_ + " --trend -o t.html").exit, 0);
  EXPECT_THAT(file("t.html"), HasSubstr("Models: 2."));
  EXPECT_EQ(report(first_ + " --trend --compare " + second_).exit, 2);
}

TEST_F(ReportCli, TheTrendLeavesADamagedModelOutAndSaysSo) {
  test::write_text(folder_ / "store" / "models" / (second_ + ".json"), "{");
  const auto ran = report(first_ + " --trend -o t.html");
  EXPECT_EQ(ran.exit, 0);
  EXPECT_THAT(ran.err, HasSubstr("model " + second_ + " is left out"));
  EXPECT_THAT(file("t.html"), HasSubstr("Models: 1."));
}

TEST_F(ReportCli, WritesACertificateWithTheDetailsOfTheExample) {
  write_details("2024-05");
  const auto third = ModelStore::open(folder_ / "store")
                         ->add(test::synthetic_document(3), true, {}, {"turner", "", {}})
                         .value();
  const auto ran =
      report(first_ + " --details details.toml --dcc c.xml --as-left " + third + " -o r.html");
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(file("c.xml"), AllOf(HasSubstr("schemaVersion=\"3.2.1\""), HasSubstr(">As left<"),
                                   HasSubstr("600-0815")));
  EXPECT_THAT(file("r.html"), AllOf(HasSubstr("600-0815"), HasSubstr("2500 mm/min"),
                                    HasSubstr("20.40 \u00b1 0.60 C")));
}

TEST_F(ReportCli, RefusesACertificateOfARefusedModelAndStatesAForcedOne) {
  write_details("2024-05");
  const std::string options = " --details details.toml --dcc c.xml -o r.html";
  const auto refused = report(second_ + options);
  EXPECT_EQ(refused.exit, 5);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("(as found)"), HasSubstr("refused by the gate: no better"),
                    HasSubstr("--force")));
  EXPECT_FALSE(fs::exists(folder_ / "c.xml"));
  const auto left = report(first_ + options + " --as-left " + second_);
  EXPECT_EQ(left.exit, 5);
  EXPECT_THAT(left.err, HasSubstr("(as left)"));

  EXPECT_EQ(report(second_ + options + " --force").exit, 2);
  const auto forced = report(second_ + options + " --force --why 'customer insists'");
  ASSERT_EQ(forced.exit, 0) << forced.err;
  EXPECT_THAT(forced.out, HasSubstr("verdict     Red: the gate refused the model"));
  const auto stated =
      AllOf(HasSubstr("no better"), HasSubstr("forced by"), HasSubstr("customer insists"));
  EXPECT_THAT(file("c.xml"), stated);
  const std::string page = file("r.html");
  EXPECT_THAT(page.substr(0, page.find("Volumetric error")), stated);
}

TEST_F(ReportCli, ACertificateOfAModelThatWasNotJudgedStatesThat) {
  auto document = test::synthetic_document(3);
  document.verdict.reset();
  test::write_text(folder_ / "earlier.json", to_json(document));
  write_details("2024-05");
  const auto ran = report("earlier.json --details details.toml --dcc c.xml -o r.html");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("No verdict"));
  EXPECT_THAT(file("c.xml"), HasSubstr("verdict: not judged"));
  EXPECT_THAT(file("r.html"), HasSubstr("No verdict"));
}

TEST_F(ReportCli, OfAFileHasTheVerdictOfTheFile) {
  auto document = test::synthetic_document(3);
  document.verdict = ModelVerdict{.reasons = {"no better"}, .notes = {"dry air"}};
  test::write_text(folder_ / "refused.json", to_json(document));
  ASSERT_EQ(report("refused.json -o r.html").exit, 0);
  EXPECT_THAT(file("r.html"), AllOf(HasSubstr("Red: the gate refused the model"),
                                    HasSubstr("no better"), HasSubstr("dry air")));
}

TEST_F(ReportCli, WritesNothingIfAnythingIsWrong) {
  const auto without = report(first_ + " --dcc c.xml -o r.html");
  EXPECT_EQ(without.exit, 3);
  EXPECT_THAT(without.err, AllOf(HasSubstr("--details"), HasSubstr("machine.serial")));
  test::write_text(folder_ / "bad.toml",
                   "[certificate]\nlocation = \"moon\"\nissue_date = \"2026-13-01\"\n[machne]\n");
  const auto bad = report(first_ + " --details bad.toml -o r.html");
  EXPECT_EQ(bad.exit, 3);
  EXPECT_THAT(bad.err,
              AllOf(HasSubstr("bad.toml:2"), HasSubstr("bad.toml:3"), HasSubstr("machne")));
  EXPECT_EQ(report("ffff1234 -o r.html").exit, 2);
  EXPECT_EQ(report("missing.json -o r.html").exit, 4);
  const auto nowhere = report(first_ + " -o nowhere/r.html");
  EXPECT_EQ(nowhere.exit, 4);
  EXPECT_THAT(nowhere.err, HasSubstr("write nowhere/r.html: there is no folder nowhere"));
  const auto folder = report(first_ + " -o r.html --pdf store");
  EXPECT_EQ(folder.exit, 4);
  EXPECT_THAT(folder.err, HasSubstr("write store: it exists and is not a file"));
  auto other = test::synthetic_document(3);
  other.machine = "lathe";
  test::write_text(folder_ / "lathe.json", to_json(other));
  const auto two = report(first_ + " --compare lathe.json -o r.html");
  EXPECT_EQ(two.exit, 2);
  EXPECT_THAT(two.err, AllOf(HasSubstr("--compare: model "), HasSubstr("is of machine \"lathe\"")));
  EXPECT_EQ(report(first_ + " --as-left " + second_).exit, 2) << "needs --dcc";
  EXPECT_FALSE(fs::exists(folder_ / "r.html"));
}

TEST_F(ReportCli, ReplacesNoFileThatItReadsOrWrites) {
  test::write_text(folder_ / "m.json", to_json(test::synthetic_document(1)));
  test::write_text(folder_ / "details.toml", "[certificate]\nlocation = \"laboratory\"\n");
  const std::string before = file("m.json");
  const auto refused = [&](const std::string& arguments) {
    const auto ran = report(arguments);
    EXPECT_EQ(ran.exit, 2) << arguments << ran.err;
    return ran.err;
  };
  EXPECT_THAT(refused("m.json -o m.json"), HasSubstr("write m.json: this command reads this file"));
  EXPECT_THAT(refused(first_ + " --compare m.json -o m.json"), HasSubstr("reads this file"));
  EXPECT_THAT(refused("m.json -o r.html --pdf ./m.json"), HasSubstr("reads this file"));
  EXPECT_THAT(refused("m.json --details details.toml -o details.toml"),
              HasSubstr("reads this file"));
  EXPECT_THAT(refused("m.json -o r.html --dcc ./r.html"), HasSubstr("named for two outputs"));
  const auto stored = ModelStore::open(folder_ / "store").value().model_path(second_);
  const std::string model = test::text_of(stored);
  EXPECT_THAT(refused(second_ + " -o " + stored.string()), HasSubstr("reads this file"));
  EXPECT_THAT(refused("m.json --compare " + second_ + " -o " + stored.string()),
              HasSubstr("reads this file"));
  EXPECT_THAT(refused(first_ + " --trend -o " + stored.string()), HasSubstr("reads this file"));
  EXPECT_EQ(test::text_of(stored), model);
  EXPECT_EQ(file("m.json"), before);
  EXPECT_FALSE(fs::exists(folder_ / "r.html"));
}

TEST_F(ReportCli, SaysThatNoPdfConverterIsInstalled) {
  const std::string command = fmt::format("report {} -o r.html --pdf r.pdf --store store", first_);
  const int status = std::system(fmt::format("cd '{}' && PATH=/nowhere '{}' {} 2>err >/dev/null",
                                             folder_.string(), ABBE_PROGRAM, command)
                                     .c_str());
  EXPECT_EQ(WEXITSTATUS(status), 4);
  EXPECT_THAT(file("err"), HasSubstr("install weasyprint or chromium"));
  EXPECT_THAT(file("err"), Not(HasSubstr("terminate")));
}

}  // namespace
}  // namespace abbe::daemon
