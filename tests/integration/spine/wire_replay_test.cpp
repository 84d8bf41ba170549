/// The golden recordings on the wire: abbe-sim serves what a device sent to an unmodified daemon on
/// real sockets, and the daemon must make the checked samples of it once more.
///
/// Host times, and how settled the clock model was, differ from run to run. Everything else in a
/// line must be the same, and no line may be missing. There may be more: a device that only answers
/// (encoders a SYNC, Modbus a question) is asked once more here and there, and when a recording is
/// over a replay stands still or restarts.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <regex>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "program.hpp"

namespace abbe::test {
namespace {

namespace fs = std::filesystem;
using Lines = std::vector<std::string>;

const fs::path kGolden = ABBE_GOLDEN_RECORDINGS;
// lines of a device that continues after the end of its recording
constexpr std::size_t kMoreThanEnough = 4;
constexpr std::chrono::seconds kRecordedAndRead{40};

Lines lines_of(const std::string& text) {
  std::istringstream in{text};
  Lines lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// "point 365.918 clock-unsettled restarted | 0.89": without the time and what depends on it.
std::string told(const std::string& line) {
  const auto bar = line.find('|');
  std::istringstream head{line.substr(0, bar)};
  std::string out, word;
  for (int i = 0; head >> word; ++i)
    if (i != 1 && word != "clock-unsettled" && word != "time-widened") out += word + ' ';
  return out + line.substr(bar);
}

Lines of_kind(const Lines& lines, std::string_view kind) {
  Lines out;
  for (const std::string& line : lines)
    if (line.starts_with(kind)) out.push_back(told(line));
  return out;
}

/// How many lines of `wanted` are not there in order (longest common subsequence).
std::size_t missing_from(const Lines& wanted, const Lines& found) {
  std::vector<std::size_t> common(found.size() + 1, 0);
  for (const std::string& line : wanted) {
    std::size_t diagonal = 0;
    for (std::size_t j = 0; j < found.size(); ++j) {
      const std::size_t above = common[j + 1];
      common[j + 1] = line == found[j] ? diagonal + 1 : std::max(above, common[j]);
      diagonal = above;
    }
  }
  return wanted.size() - common.back();
}

/// abbe-sim with one golden recording and abbed with the configuration it was recorded with.
class WireRun {
 public:
  explicit WireRun(std::string name) : name_(std::move(name)) {
    std::string pattern = testing::TempDir() + "abbe-wire-XXXXXX";
    folder_ = ::mkdtemp(pattern.data());
    wanted_ = lines_of(text_of(kGolden / (name_ + ".chk")));
    const auto packed = (kGolden / (name_ + ".mcap.gz")).string();
    EXPECT_EQ(std::system(("gzip -dc '" + packed + "' >'" + file("golden.mcap") + "'").c_str()), 0);
    simulator_ = std::make_unique<Program>(
        std::vector<std::string>{ABBE_SIM_PROGRAM, "replay", file("golden.mcap"), "--ports-file",
                                 file("ports")},
        folder_ / "sim");
  }
  void start_abbed() {
    ASSERT_TRUE(eventually([&] { return fs::exists(file("ports")); })) << simulator_->err();
    auto recording = daemon::RecordingReader::open(file("golden.mcap"));
    ASSERT_TRUE(recording) << recording.error().text;
    std::ofstream(file("abbed.toml")) << at_its_place(recording->info().configuration);
    abbed_ = std::make_unique<Program>(
        std::vector<std::string>{ABBED_PROGRAM, "-c", file("abbed.toml")}, folder_ / "abbed");
    // A program that starts takes time from those that run.
    EXPECT_TRUE(eventually([&] { return status().is_object(); })) << abbed_->err();
  }
  /// What the measuring machine was asked then.
  void start_touching() {
    if (!name_.starts_with("cmm-")) return;
    EXPECT_TRUE(eventually([&] { return ready_to_touch(); })) << status().dump(1);
    artefact_ = std::make_unique<Program>(
        std::vector<std::string>{ABBE_PROGRAM, "calibrate", "artefact", "--calibrator",
                                 (kGolden / "artefact.toml").string(), "-c", file("abbed.toml"),
                                 "-o", file("calibrator.toml"), "--at-mm", "0,0,0", "--points", "5",
                                 "--block-points", "4"},
        folder_ / "artefact");
  }
  /// Until the daemon has as many samples as were checked, then no longer. What differs, for
  /// people; empty: nothing.
  std::string finish() {
    if (artefact_) artefact_->wait_for_end();  // with a fault it does not get to its end
    std::string differs;
    if (!artefact_ && !eventually([&] { return enough(); }, kRecordedAndRead))
      differs =
          "not enough samples: " + simulator_->err() + abbed_->err() + status().dump(1) + '\n';
    EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
    const Lines found = recorded();

    // How often the position of a measuring machine is requested depends on the times of the
    // touch requests.
    const Lines kinds =
        artefact_ ? Lines{"touch"} : Lines{"point", "weather", "axes", "air", "touch"};
    for (const std::string& kind : kinds) {
      const Lines wanted = of_kind(wanted_, kind);
      const Lines seen = of_kind(found, kind);
      if (const std::size_t missing = missing_from(wanted, seen))
        differs += fmt::format("{} of {} lines {} missing\n", missing, wanted.size(), kind);
    }

    if (differs.empty()) fs::remove_all(folder_);
    return differs.empty() ? differs
                           : fmt::format("{} in {}: {}", name_, folder_.string(), differs);
  }

 private:
  Lines recorded() {
    fs::path recording;
    for (const auto& entry : fs::directory_iterator(folder_ / "data" / "recordings"))
      recording = entry.path();
    Program replay({ABBE_PROGRAM, "replay", "--samples", recording.string()}, folder_ / "replay");
    EXPECT_EQ(replay.wait_for_end(), 0) << replay.err();
    return lines_of(replay.out());
  }
  [[nodiscard]] std::string file(const std::string& name) const {
    return (folder_ / name).string();
  }

  /// The recorded configuration, its device where the simulator has it now.
  [[nodiscard]] std::string at_its_place(std::string configuration) const {
    const std::string ports = text_of(file("ports"));
    std::smatch seen;
    if (std::regex_search(ports, seen, std::regex{"_path=\"(.*)\""})) {
      configuration =
          replaced(configuration, "serial = \"[^\"]*\"", "serial = \"" + seen[1].str() + "\"");
    } else if (std::regex_search(ports, seen, std::regex{"_port=([0-9]+)"})) {
      configuration = replaced(configuration, "port = [0-9]+", "port = " + seen[1].str());
    }
    return replaced(configuration, "simulated = true", "simulated = true\nrealtime = \"ignore\"");
  }
  [[nodiscard]] nlohmann::json status() const {
    const auto answer = daemon::ask_daemon(folder_ / "run" / "control.sock", {{"do", "status"}});
    return answer ? *answer : nlohmann::json{};
  }
  [[nodiscard]] bool ready_to_touch() const {
    return daemon::ask_daemon(folder_ / "run" / "control.sock", {{"do", "touch"}, {"where", true}})
        .has_value();
  }
  [[nodiscard]] bool enough() const {
    if (simulator_->err().find("everything served") == std::string::npos) return false;
    const auto now = status();
    if (!now.is_object()) return false;
    const bool goes_on = !name_.starts_with("tracker") && !name_.starts_with("counter_card");
    std::size_t wanted = goes_on ? kMoreThanEnough : 0;
    for (const std::string& line : wanted_)
      wanted +=
          line.starts_with("point") || line.starts_with("axes") || line.starts_with("air") ? 1 : 0;
    std::size_t samples = 0;
    for (const auto& stream : now["streams"])
      if (stream["name"] != "recorder") samples += stream["samples"].get<std::size_t>();
    return samples >= wanted;
  }

  std::string name_;
  fs::path folder_;
  Lines wanted_;
  std::unique_ptr<Program> simulator_;
  std::unique_ptr<Program> abbed_;
  std::unique_ptr<Program> artefact_;
};

/// Beside each other: they mostly wait.
Lines differences(std::span<const std::string> names) {
  std::vector<std::unique_ptr<WireRun>> runs;
  for (const std::string& name : names) runs.push_back(std::make_unique<WireRun>(name));
  for (const auto& run : runs) run->start_abbed();
  for (const auto& run : runs) run->start_touching();
  Lines all;
  for (const auto& run : runs) all.push_back(run->finish());
  return all;
}

/// Time is real here: a machine that gives a daemon none for a tenth of a second makes silence of
/// it. What is wrong is wrong every time.
Lines lasting_differences(std::span<const std::string> names) {
  constexpr int kAttempts = 3;
  Lines left{names.begin(), names.end()};
  Lines differing;
  for (int attempt = 0; attempt < kAttempts && !left.empty(); ++attempt) {
    differing = differences(left);
    Lines again;
    for (std::size_t i = 0; i < left.size(); ++i)
      if (!differing[i].empty()) again.push_back(left[i]);
    std::erase(differing, std::string{});
    left = std::move(again);
  }
  return differing;
}

/// Of every device, and of every kind of fault one that its driver must get over.
Lines chosen() {
  Lines names{"tracker-disconnect",     "encoder-restart",   "counter_card-unplug",
              "environment-disconnect", "serial-disconnect", "cmm-plain"};
  // Sanitized programs need the machine's time for themselves.
  if (!ABBE_SANITIZED)
    names.insert(names.end(), {"tracker-garbage", "tracker-mute", "counter_card-overrun",
                               "environment-late", "serial-garbage", "cmm-refuse_touch"});
  return names;
}
Lines all() {
  Lines names;
  for (const auto& entry : fs::directory_iterator(kGolden))
    if (entry.path().extension() == ".chk") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

/// With ABBE_GOLDEN=all in the environment every recording, which takes a minute.
TEST(GoldenRecordings, GiveTheCheckedSamplesOnTheWire) {
  constexpr std::size_t kBesideEachOther = ABBE_SANITIZED ? 3 : 13;
  const char* which = std::getenv("ABBE_GOLDEN");
  const Lines names = which != nullptr && which == std::string_view{"all"} ? all() : chosen();
  Lines differing;
  for (std::size_t i = 0; i < names.size(); i += kBesideEachOther) {
    const auto some = std::span{names}.subspan(i, std::min(kBesideEachOther, names.size() - i));
    for (auto& difference : lasting_differences(some)) differing.push_back(std::move(difference));
  }
  EXPECT_THAT(differing, testing::IsEmpty());
}

}  // namespace
}  // namespace abbe::test
