/// Programs for the control, read back by a small reader that was written from the controls'
/// grammars, and by LinuxCNC's interpreter where it is installed.
#include "abbe/methods/otf/path_program.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <regex>
#include <sstream>

#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using calib::Vector3;
using ::testing::HasSubstr;

const calib::otf::Path kVertices{
    {{-0.3, -0.25, -0.4}, {0.0, 0.25, 0.0}, {0.2999, -0.1234, -0.0001}, {0.3, 0.0, -0.4}}};
constexpr calib::otf::Drive kDrive{
    .feed_m_per_s = 2.5 / 60.0, .acceleration_m_per_s2 = 1.0, .dwell_s = 0.05};
constexpr double kStand_s = 2.0;

/// What a control does with a program.
struct Motion {
  std::vector<Vector3> moves_m;
  std::vector<double> feeds;    ///< mm/min, of each move
  std::vector<double> dwell_s;  ///< after each move, in total
  std::size_t stops = 0;        ///< of the program, by the operator's leave
  std::size_t stop_after = 0;   ///< moves before the last stop
  bool ended = false;
};

/// Number after an address; nullopt: the block has no such word.
std::optional<double> word(const std::string& block, const std::string& address) {
  const std::regex form("(^|\\s)" + address + "([+-]?[0-9]*\\.?[0-9]+)(?=\\s|$)");
  std::smatch found;
  if (!std::regex_search(block, found, form)) return std::nullopt;
  return std::stod(found[2]);
}

void move_to(Motion& motion, const std::string& block) {
  const auto x = word(block, "X"), y = word(block, "Y"), z = word(block, "Z"), f = word(block, "F");
  ASSERT_TRUE(x && y && z && f) << block;
  motion.moves_m.emplace_back(*x / 1e3, *y / 1e3, *z / 1e3);
  motion.feeds.push_back(*f);
  motion.dwell_s.push_back(0.0);
}

void dwell(Motion& motion, std::optional<double> seconds, const std::string& block) {
  ASSERT_TRUE(seconds && !motion.dwell_s.empty()) << block;
  motion.dwell_s.back() += *seconds;
}

void stop(Motion& motion) {
  ++motion.stops;
  motion.stop_after = motion.moves_m.size();
}

bool has(const std::string& block, const std::string& exact_word) {
  return std::regex_search(block, std::regex("(^|\\s)" + exact_word + "(?=\\s|$)"));
}

/// LinuxCNC and Siemens: words of DIN 66025. `machine_word`: makes a block absolute in machine
/// coordinates; `dwell_word`: seconds of G4; `comment`: where one begins.
Motion read_iso(const std::string& text, const std::string& machine_word,
                const std::string& dwell_word, char comment, const std::string& end) {
  Motion motion;
  std::istringstream lines(text);
  for (std::string block; std::getline(lines, block);) {
    block = block.substr(0, block.find(comment));
    if (has(block, "G4")) {
      dwell(motion, word(block, dwell_word), block);
    } else if (has(block, "G1")) {
      EXPECT_TRUE(has(block, machine_word)) << block;
      move_to(motion, block);
    } else if (has(block, "M0")) {
      stop(motion);
    }
    motion.ended = motion.ended || has(block, end);
  }
  return motion;
}

/// Heidenhain: numbered blocks between BEGIN PGM and END PGM.
Motion read_klartext(const std::string& text) {
  Motion motion;
  std::istringstream lines(text);
  std::size_t expected = 0;
  for (std::string line; std::getline(lines, line); ++expected) {
    std::istringstream block(line);
    std::size_t number = 0;
    std::string first;
    block >> number >> first;
    EXPECT_EQ(number, expected) << line;
    if (first == "L") {
      EXPECT_TRUE(has(line, "R0") && has(line, "M91")) << line;
      move_to(motion, line);
    } else if (first == "STOP") {
      stop(motion);
    } else if (line.find("CYCL DEF 9.1") != std::string::npos) {
      dwell(motion, word(line, "DWELL "), line);
    }
    motion.ended = first == "END";
  }
  return motion;
}

void expect_the_path(const Motion& motion) {
  ASSERT_EQ(motion.moves_m.size(), kVertices.vertices_m.size());
  for (std::size_t i = 0; i < motion.moves_m.size(); ++i) {
    EXPECT_LT((motion.moves_m[i] - kVertices.vertices_m[i]).norm(), 1e-9) << i;
    EXPECT_NEAR(motion.feeds[i], 2500.0, 1e-9);
  }
  EXPECT_THAT(motion.dwell_s, ::testing::ElementsAre(kStand_s, 0.05, 0.05, kStand_s));
  EXPECT_EQ(motion.stops, 1u);
  EXPECT_EQ(motion.stop_after, 1u);  // at the first vertex: then the session is started
  EXPECT_TRUE(motion.ended);
}

TEST(PathProgram, OfLinuxCncIsThePath) {
  const std::string text = path_program(kVertices, kDrive, kStand_s, Dialect::LinuxCnc);
  EXPECT_THAT(text, HasSubstr("G21 G17 G40 G49 G80 G90 G94\nG61.1\n"));
  expect_the_path(read_iso(text, "G53", "P", '(', "M2"));
}

TEST(PathProgram, OfSiemensIsThePath) {
  const std::string text = path_program(kVertices, kDrive, kStand_s, Dialect::Siemens);
  EXPECT_THAT(text, HasSubstr("G710 G90 G94 G60"));
  expect_the_path(read_iso(text, "SUPA", "F", ';', "M30"));
}

TEST(PathProgram, OfHeidenhainIsThePath) {
  const std::string text = path_program(kVertices, kDrive, kStand_s, Dialect::Heidenhain);
  EXPECT_TRUE(text.starts_with("0 BEGIN PGM OTFPATH MM\n"));
  expect_the_path(read_klartext(text));
}

TEST(PathProgram, HasANameAndAnExtensionForEachDialect) {
  for (const Dialect dialect : kDialects) EXPECT_EQ(dialect_named(name(dialect)), dialect);
  EXPECT_EQ(dialect_named("fanuc"), std::nullopt);
  EXPECT_EQ(extension(Dialect::Heidenhain), ".h");
}

/// ABBE_RS274: where the interpreter is not in /usr/bin.
std::optional<std::string> rs274() {
  const char* configured = std::getenv("ABBE_RS274");
  const std::string program = configured != nullptr ? configured : "/usr/bin/rs274";
  return ::access(program.c_str(), X_OK) == 0 ? std::optional(program) : std::nullopt;
}

/// What the interpreter commands the machine, one canonical command in a line.
Motion interpreted(const std::string& canonical) {
  Motion motion;
  double feed = 0.0;
  std::istringstream lines(canonical);
  const std::regex number("-?[0-9]+\\.[0-9]+");
  for (std::string line; std::getline(lines, line);) {
    std::vector<double> values;
    for (std::sregex_iterator it(line.begin(), line.end(), number), end; it != end; ++it)
      values.push_back(std::stod(it->str()));
    if (line.find("SET_FEED_RATE") != std::string::npos) feed = values.at(0);
    if (line.find("STRAIGHT_FEED") != std::string::npos) {
      motion.moves_m.emplace_back(values.at(0) / 1e3, values.at(1) / 1e3, values.at(2) / 1e3);
      motion.feeds.push_back(feed);
      motion.dwell_s.push_back(0.0);
    }
    if (line.find("DWELL") != std::string::npos) motion.dwell_s.back() += values.at(0);
    if (line.find("PROGRAM_STOP") != std::string::npos) stop(motion);
    motion.ended = motion.ended || line.find("PROGRAM_END") != std::string::npos;
  }
  return motion;
}

TEST(PathProgram, IsAcceptedByTheInterpreterOfLinuxCnc) {
  const auto program = rs274();
  if (!program) GTEST_SKIP() << "rs274 of Debian's linuxcnc-uspace is not installed";
  const fs::path folder = fs::path(::testing::TempDir()) / fmt::format("rs274_{}", ::getpid());
  fs::create_directories(folder);
  test::write_text(folder / "path.ngc",
                   path_program(kVertices, kDrive, kStand_s, Dialect::LinuxCnc));
  test::write_text(folder / "tool.tbl", "T1 P1 Z0 D0.1\n");
  const int status = std::system(
      fmt::format("cd '{}' && '{}' -g path.ngc -t tool.tbl >out 2>err", folder.string(), *program)
          .c_str());
  EXPECT_EQ(status, 0) << test::text_of(folder / "err");
  const std::string out = test::text_of(folder / "out");
  EXPECT_THAT(out, HasSubstr("SET_MOTION_CONTROL_MODE(CANON_EXACT_STOP)"));
  expect_the_path(interpreted(out));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace abbe::daemon
