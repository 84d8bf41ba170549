/// abbe-sim mfb and abbe-sim bar as programs: files, exit codes, messages.

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace abbe::sim {
namespace {

using testing::HasSubstr;

class MfbProgram : public testing::Test {
 protected:
  struct Outcome {
    int code;
    std::string output;  ///< both streams
  };

  MfbProgram()
      : folder_(std::filesystem::temp_directory_path() /
                ("abbe_sim_mfb_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~MfbProgram() override { std::filesystem::remove_all(folder_); }

  /// Runs in the folder.
  Outcome run(const std::string& arguments) const {
    const std::string command =
        "cd " + folder_.string() + " && " ABBE_SIM_PROGRAM " " + arguments + " 2>&1";
    std::FILE* pipe = ::popen(command.c_str(), "r");
    std::string output;
    for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) output += static_cast<char>(c);
    const int status = ::pclose(pipe);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, output};
  }
  std::string text(const std::string& file) const {
    std::ostringstream all;
    all << std::ifstream(folder_ / file).rdbuf();
    return all.str();
  }

  std::filesystem::path folder_;
};

TEST_F(MfbProgram, WritesTheFilesOfACalibration) {
  const Outcome ran =
      run("mfb --passes forward --form-um 0.25 --u-bar-um 0.1,0.2,0.3 --miss X1,hole,3,,2 "
          "Y1,rod,2,,0 -o made/run");
  ASSERT_EQ(ran.code, 0) << ran.output;
  const std::string points = text("made/run/points.csv");
  EXPECT_EQ(std::count(points.begin(), points.end(), '\n'), 1 + 17 * 316 - 2);
  EXPECT_THAT(text("made/run/plan.toml"), HasSubstr("name = \"DYZ2\""));
  EXPECT_THAT(text("made/run/bar.toml"), HasSubstr("[sag]"));
  EXPECT_THAT(text("made/run/bar.toml"), HasSubstr("u_um = [0.1, 0.2, 0.3]"));
  EXPECT_THAT(text("made/run/machine.toml"), HasSubstr("basis = \"cubic\""));
  EXPECT_THAT(text("made/run/verification.csv"), HasSubstr("tracker_x_mm"));

  const Outcome truth = run("truth --config made/run/sim.toml --tool-mm=0,0,-150 --grid 2 2 2");
  EXPECT_EQ(truth.code, 0) << truth.output;
  EXPECT_NE(truth.output, run("truth --config made/run/sim.toml --grid 2 2 2").output);
}

TEST_F(MfbProgram, RepeatsItselfWithTheSameSeed) {
  ASSERT_EQ(run("mfb --seed 9 --plan 12 -o first").code, 0);
  ASSERT_EQ(run("mfb --seed 9 --plan 12 -o second").code, 0);
  ASSERT_EQ(run("mfb --seed 10 --plan 12 -o third").code, 0);
  for (const char* file : {"/points.csv", "/bar.toml", "/plan.toml", "/truth.csv"}) {
    EXPECT_EQ(text(std::string("first") + file), text(std::string("second") + file));
    EXPECT_NE(text(std::string("first") + file), text(std::string("third") + file));
  }
}

TEST_F(MfbProgram, MeasuresTheBarThatWasCalibrated) {
  ASSERT_EQ(run("mfb --seed 4 --bar-seed 2 --plan 12 --passes forward -o machine").code, 0);
  ASSERT_EQ(run("bar --seed 5 --bar-seed 2 --repeats 2 -o calibration").code, 0);
  EXPECT_EQ(text("machine/truebar.csv"), text("calibration/truebar.csv"));
  EXPECT_THAT(text("calibration/gauge.toml"), HasSubstr("readings_mm"));
  EXPECT_THAT(text("calibration/plan.toml"), HasSubstr("bar_z = [0, 0, -1]"));
}

TEST_F(MfbProgram, WrongOptionsAreUsageErrors) {
  const std::pair<const char*, const char*> cases[] = {
      {"mfb", "--out"},
      {"mfb -o out --plan 14", "--plan"},
      {"mfb -o out --drift-um -1", "--drift-um"},
      {"mfb -o out --tip-radius-mm 9", "tip radius"},
      {"mfb -o out --holes 5", "--holes"},
      {"mfb -o out --u-bar-um 0.2,0.3", "--u-bar-um"},
      {"mfb -o out --outlier-um X1,hole,3,,2", "NAME=VALUE"},
      {"mfb -o out --outlier-um X1,hole,3,,2=much", "much"},
      {"mfb -o out --outlier-um X1,hole,13,,2=50", "X1,hole,13,,2"},
      {"mfb -o out --miss X1,hole,3,2", "X1,hole,3,2"},
      {"mfb -o out --turned X9=z", "X9"},
      {"mfb -o out --turned X1=w", "x, y or z"},
      {"bar -o out --gauge-beside-mm 3", "--gauge-beside-mm"},
      {"bar -o out --gauge-turned-mrad 3", "--gauge-turned-mrad"},
      {"bar -o out --gauge-travel y", "--gauge-travel"},
      {"bar -o out --repeats 0", "--repeats"}};
  for (const auto& [arguments, what] : cases) {
    const Outcome ran = run(arguments);
    EXPECT_EQ(ran.code, 2) << arguments << "\n" << ran.output;
    EXPECT_THAT(ran.output, HasSubstr(what)) << arguments;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out")) << arguments;
  }
}

TEST_F(MfbProgram, FolderThatCannotBeWrittenIsAnIoError) {
  std::ofstream(folder_ / "file") << "";
  const Outcome ran = run("mfb --plan 12 --passes forward -o file");
  EXPECT_EQ(ran.code, 4);
  EXPECT_THAT(ran.output, HasSubstr("file"));
}

}  // namespace
}  // namespace abbe::sim
