/// abbe-sim as a program: exit codes, messages, files.

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "loopback_client.hpp"
#include "reference_case.hpp"

namespace abbe::sim {
namespace {

using testing::HasSubstr;

class Program : public testing::Test {
 protected:
  struct Outcome {
    int code;
    std::string output;  ///< both streams
  };

  Program()
      : folder_(std::filesystem::temp_directory_path() /
                ("abbe_sim_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~Program() override { std::filesystem::remove_all(folder_); }

  static Outcome run(const std::string& arguments) {
    std::FILE* pipe =
        ::popen((std::string(ABBE_SIM_PROGRAM " ") + arguments + " 2>&1").c_str(), "r");
    std::string output;
    for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) output += static_cast<char>(c);
    const int status = ::pclose(pipe);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, output};
  }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }

  const std::string demo_ = ABBE_DEMO_DIR;
  std::filesystem::path folder_;
};

TEST_F(Program, WithoutACommandIsAUsageError) {
  EXPECT_EQ(run("").code, 2);
}

TEST_F(Program, HelpNamesItsCommandsAndExitCodes) {
  const Outcome help = run("--help");
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.output, HasSubstr("run"));
  EXPECT_THAT(help.output, HasSubstr("Exit codes: 0 done; 2 usage; 3 invalid input file; "));
}

TEST_F(Program, TellsItsVersion) {
  const Outcome version = run("--version");
  EXPECT_EQ(version.code, 0);
  EXPECT_THAT(version.output, testing::StartsWith("abbe-sim "));
}

TEST_F(Program, TheHelpOfEveryCommandHasAnExample) {
  for (const std::string command : {"run", "truth", "machine", "replay", "evemu"})
    EXPECT_THAT(run(command + " --help").output, HasSubstr("Example: abbe-sim " + command));
}

/// The TOML parser recurses, and so do the copies of its result.
TEST_F(Program, RefusesATomlFileThatNestsTooDeepOrIsTooLarge) {
  std::string key = "a";
  for (int i = 0; i < 40'000; ++i) key += ".a";
  const std::string brackets = "x = " + std::string(40'000, '[');
  const std::string machine = " --machine " + demo_ + "/machine.toml";

  for (const auto& text : {key + " = 1\n", "\n\n" + brackets + "\n", "[" + key + "]\n"}) {
    const std::string file = write("deep.toml", text);
    for (const auto& arguments : {"run --machine " + file, "run --config " + file + machine}) {
      const Outcome outcome = run(arguments);
      EXPECT_EQ(outcome.code, 3) << outcome.output;
      EXPECT_THAT(outcome.output, HasSubstr("nested deeper than 64"));
      EXPECT_THAT(outcome.output,
                  HasSubstr(text.front() == '\n' ? "deep.toml:3:" : "deep.toml:1:"));
    }
  }

  const Outcome large = run("run --machine " + write("large.toml", std::string(2 << 20, '#')));
  EXPECT_EQ(large.code, 3);
  EXPECT_THAT(large.output, HasSubstr("at most 1048576 are read"));
}

TEST_F(Program, ReportsAMissingMachineOrPath) {
  EXPECT_EQ(run("run").code, 2);
  const Outcome no_path = run("run --machine " + demo_ + "/machine.toml");
  EXPECT_EQ(no_path.code, 2);
  EXPECT_THAT(no_path.output, HasSubstr("--path"));
}

TEST_F(Program, AMissingFileIsAnInputOutputError) {
  const Outcome outcome = run("run --machine /nowhere/machine.toml");
  EXPECT_EQ(outcome.code, 4);
  EXPECT_THAT(outcome.output, HasSubstr("/nowhere/machine.toml"));
}

TEST_F(Program, ReportsAllFaultsOfAConfigurationTogether) {
  const std::string config =
      write("bad.toml",
            "[sim]\nspeed = \"fast\"\nfoo = 1\n[sim.path]\nfeed_mm_per_min = -3\n"
            "[[sim.fault]]\ndevice = \"tracker\"\nkind = \"flood\"\nat_s = 1\n");
  const Outcome outcome = run("run --config " + config + " --machine " + demo_ + "/machine.toml");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.output, HasSubstr("bad.toml:2:9: sim.speed: must be a number, not a string"));
  EXPECT_THAT(outcome.output, HasSubstr("bad.toml:3:1: sim.foo: unknown key"));
  EXPECT_THAT(outcome.output, HasSubstr("bad.toml:5:19: sim.path.feed_mm_per_min"));
  EXPECT_THAT(outcome.output, HasSubstr("bad.toml:8:8: sim.fault[0].kind"));
  EXPECT_THAT(outcome.output, testing::Not(HasSubstr("sim.fault: unknown")));
}

TEST_F(Program, RefusesAnEncoderOfAnAxisThatIsNotSimulated) {
  const std::string config =
      write("abbed.toml",
            "[axes.U]\nkind = \"linear\"\nmin_mm = 0\nmax_mm = 100\n[encoder]\nnodes = [\n"
            "{axis = \"U\", node = 4},\n{axis = \"B\", node = 5}]\n");
  const Outcome outcome = run("run --machine " + config);
  EXPECT_EQ(outcome.code, 3);
  constexpr const char* kReason =
      "].axis: must be X, Y, Z or an axis with kind = \"rotary\" in [axes]";
  EXPECT_THAT(outcome.output, HasSubstr(std::string{"abbed.toml:7:9: encoder.nodes[0"} + kReason));
  EXPECT_THAT(outcome.output, HasSubstr(std::string{"abbed.toml:8:9: encoder.nodes[1"} + kReason));
  EXPECT_THAT(outcome.output, HasSubstr(": axes.X: needs min_mm and max_mm"));
}

TEST_F(Program, RefusesEncodersThatCannotBe) {
  const std::string config =
      write("abbed.toml",
            "[machine]\nchain = \"[w X b Y Z t]\"\n[axes.X]\nmin_mm = 0\nmax_mm = "
            "1\n[axes.Y]\nmin_mm = 0\n"
            "max_mm = 1\n[axes.Z]\nmin_mm = 0\nmax_mm = 1\n[axes.B]\nkind = "
            "\"rotary\"\n[encoder]\nnodes = [\n"
            "{axis = \"X\", node = 1, step_nm = 2.5},\n{axis = \"B\", node = 1}]\n");
  const Outcome outcome = run("run --machine " + config);
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.output, HasSubstr("encoder.nodes[0].step_nm: must be a whole"));
  EXPECT_THAT(outcome.output, HasSubstr("abbed.toml:17:1: encoder.nodes[1].step_nrad: missing"));
  EXPECT_THAT(outcome.output, HasSubstr("encoder.nodes[1].node: node id 1 is used twice"));
}

TEST_F(Program, RefusesAWrongPathFile) {
  const std::string path = write("path.csv", "x_mm,y_mm,z_mm\n1,2\n1,2,up\n");
  const Outcome outcome = run("run --machine " + demo_ + "/machine.toml --path " + path);
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.output, HasSubstr("path.csv:2"));
  EXPECT_THAT(outcome.output, HasSubstr("path.csv:3"));
}

TEST_F(Program, PortInUseIsOneClearMessage) {
  const Socket taken = listen_tcp(0).value();
  const std::string port = std::to_string(port_of(taken));
  const Outcome outcome = run("run --config " + demo_ + "/sim.toml --tracker-port " + port);
  EXPECT_EQ(outcome.code, 4);
  EXPECT_THAT(outcome.output, HasSubstr("127.0.0.1:" + port));
}

TEST_F(Program, ReadsADaemonsWholeConfiguration) {
  const std::string config =
      write("abbed.toml",
            "[machine]\nname = \"m\"\nchain = \"[w X' b Y Z t]\"\n[axes.X]\nmin_mm = "
            "0\nmax_mm = 100\n[axes.Y]\nmin_mm = 0\n"
            "max_mm = 100\n[axes.Z]\nmin_mm = 0\nmax_mm = 100\n[daemon]\nspeed = "
            "5\nsimulated = true\n[gate]\nmax_error_mm = 1\n"
            "[encoder]\ntransport = \"udp\"\npeer_host = \"127.0.0.1\"\npeer_port = "
            "20000\n[[encoder.nodes]]\naxis = \"X\"\n"
            "node = 5\nstep_nm = 10\n");
  EXPECT_EQ(run("truth --machine " + config + " --grid 2 2 2").code, 0);
}

TEST_F(Program, TruthFromTheTablesEqualsTruthFromTheSeed) {
  const std::string tables = (folder_ / "tables.csv").string();
  const std::string from_seed = (folder_ / "seed.csv").string();
  const std::string from_tables = (folder_ / "tables_truth.csv").string();
  const std::string machine = " --machine " + demo_ + "/machine.toml ";
  ASSERT_EQ(run("machine --seed 9" + machine + "-o " + tables).code, 0);
  ASSERT_EQ(run("truth --seed 9" + machine + "--grid 4 3 2 -o " + from_seed).code, 0);
  ASSERT_EQ(
      run("truth --truth " + tables + machine + "--points " + demo_ + "/path.csv -o " + from_tables)
          .code,
      0);
  ASSERT_EQ(run("truth --truth " + tables + machine + "--grid 4 3 2 -o " + from_tables).code, 0);
  const auto a = test::read_rows(from_seed);
  const auto b = test::read_rows(from_tables);
  ASSERT_EQ(a.size(), 25u);
  ASSERT_EQ(a.size(), b.size());
  EXPECT_THAT(a[0], testing::ElementsAre("x_mm", "y_mm", "z_mm", "ex_um", "ey_um", "ez_um"));

  for (std::size_t i = 1; i < a.size(); ++i) {
    for (std::size_t k = 3; k < 6; ++k) EXPECT_NEAR(std::stod(a[i][k]), std::stod(b[i][k]), 1e-9);
  }
}

TEST_F(Program, WritesItsPortsWhenItListensAndStopsOnASignal) {
  const std::string ports = (folder_ / "ports").string();
  const std::string config = demo_ + "/sim.toml";
  std::array<int, 2> output{};

  ASSERT_EQ(::pipe(output.data()), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(output[1], STDOUT_FILENO);
    ::execl(ABBE_SIM_PROGRAM, "abbe-sim", "run", "--config", config.c_str(), "--ports-file",
            ports.c_str(), nullptr);
    ::_exit(127);
  }
  ::close(output[1]);
  char first = 0;
  ASSERT_EQ(::read(output[0], &first, 1), 1);  // the ports are printed after the file is written
  std::ifstream in(ports);
  std::string tracker_line;
  ASSERT_TRUE(std::getline(in, tracker_line));
  ASSERT_EQ(tracker_line.rfind("tracker_port=", 0), 0u);
  const auto port = static_cast<std::uint16_t>(std::stoi(tracker_line.substr(13)));
  EXPECT_TRUE(test::connected(SOCK_STREAM, port));
  ::kill(child, SIGTERM);
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  ::close(output[0]);
}

}  // namespace
}  // namespace abbe::sim
