/// SIGKILL at random moments of whole runs: nothing that was finished is lost, and the next start
/// closes the files left open. ABBE_KILLS is the number of kills (scripts/soak kills N);
/// ABBE_KILLS_SEED repeats a run's moments.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <random>
#include <set>

#include "abbe/model/model_store.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "spine.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::IsEmpty;
namespace fs = std::filesystem;

unsigned number_from(const char* variable, unsigned otherwise) {
  const char* const text = std::getenv(variable);
  return text == nullptr ? otherwise : static_cast<unsigned>(std::strtoul(text, nullptr, 10));
}

class Kills : public Spine {
 protected:
  // A start, a run of 55 s of host time, its identification and the store: the moments lie anywhere
  // in it.
  static constexpr std::chrono::milliseconds kWholeRun{2000 + 100'000 / ABBE_SPINE_SPEED};

  Kills() : seed_(number_from("ABBE_KILLS_SEED", std::random_device{}())), random_(seed_) {
    RecordProperty("seed", std::to_string(seed_));
    write_path("path.csv", path());
  }

  std::chrono::milliseconds some_moment(std::chrono::milliseconds at_most) {
    return std::chrono::milliseconds{
        std::uniform_int_distribution<long>{0, at_most.count()}(random_)};
  }
  unsigned one_of(unsigned n) { return std::uniform_int_distribution<unsigned>{0, n - 1}(random_); }

  void begin_round() {
    fs::remove(file("ports"));
    ASSERT_NO_FATAL_FAILURE(start_simulator());
    hold_simulator();
#ifdef ABBE_WITH_DDS
    write_configuration("child");
#else
    write_configuration("off");
#endif
    ASSERT_NO_FATAL_FAILURE(start_abbed());
    calibration_ = start(
        {ABBE_PROGRAM, "calibrate", "otf", "-c", file("abbed.toml"), "--path", file("path.csv")},
        "calibrate");
  }
  /// Waits until the moment has come. The simulator starts to move when the session waits for it.
  void look_on(std::chrono::milliseconds moment) {
    const auto until = std::chrono::steady_clock::now() + moment;
    while (std::chrono::steady_clock::now() < until && abbed_->running()) {
      note(status());
      wait_a_little();
    }
  }
  /// What abbed has reported as done.
  void note(const json& now) {
    if (!now.is_object()) return;
    const json& session = now["session"];
    if (session["state"] == "warming") simulator_->signal(SIGCONT);
    if (const std::string id = session["model_id"]; !id.empty()) models_.insert(id);
    for (const json& stream : now["streams"])
      if (stream["name"] == "recorder") recorded_ = stream["samples"];
    recording_ = now.value("recording", "");
  }

  /// The finished chunks are in the file that was left; the next start must not lose one of them.
  void expect_chunks() {
    if (recorded_ == 0 || recording_.empty()) return;
    const auto reader = daemon::RecordingReader::open(recording_);
    ASSERT_TRUE(reader) << reader.error().text;
    EXPECT_GE(reader->message_count(), recorded_) << recording_;
    EXPECT_THAT(reader->damage(), IsEmpty());
    left_[fs::path{recording_}.replace_extension().string()] = reader->message_count();
  }
  void expect_models() {
    const auto store = daemon::ModelStore::open(directory_ / "data" / "models");
    ASSERT_TRUE(store) << store.error().text;
    const auto entries = store->list();
    ASSERT_TRUE(entries) << entries.error().text;
    std::set<std::string> stored;
    for (const auto& entry : *entries) {
      EXPECT_THAT(entry.fault, IsEmpty()) << entry.id;
      stored.insert(entry.id);
    }
    for (const auto& id : models_) EXPECT_TRUE(stored.contains(id)) << "lost: " << id;
    models_ = std::move(stored);
  }
  [[nodiscard]] std::vector<fs::path> temporary_files() const {
    std::vector<fs::path> found;
    std::error_code error;  // a file may disappear meanwhile
    for (fs::recursive_directory_iterator one(directory_ / "data" / "models", error), end;
         !error && one != end; one.increment(error))
      if (one->path().extension() == ".new") found.push_back(one->path());
    return found;
  }
  void expect_no_leftovers() {
    const auto is_open = [this](const fs::path& part) {
      return part.filename() == fs::path{status().value("recording", "")}.filename();
    };

    for (const auto& left : left_) {
      const auto& finished = left.first;  // a structured binding cannot be captured with clang 14
      ASSERT_TRUE(eventually([&] { return fs::exists(finished); })) << finished << "\n"
                                                                    << abbed_->err();
      const auto reader = daemon::RecordingReader::open(finished);
      ASSERT_TRUE(reader) << reader.error().text;
      EXPECT_TRUE(reader->closed_cleanly()) << finished;
      EXPECT_TRUE(reader->losses().empty()) << finished << ": " << reader->losses()[0].what;
      EXPECT_EQ(reader->message_count(), left.second) << finished;
      fs::remove(finished);  // hundreds of them
    }

    left_.clear();
    EXPECT_TRUE(eventually([&] {
      for (const auto& one : recordings())
        if (one.extension() == ".part" && !is_open(one)) return false;
      return true;
    })) << abbed_->err();
    // The running abbed makes its index in the background: a temporary file of its own may be there
    // for a moment.
    EXPECT_TRUE(eventually([&] { return temporary_files().empty(); }))
        << testing::PrintToString(temporary_files());
  }

  void kill_abbed() {
    look_on(some_moment(kWholeRun));
    abbed_->signal(SIGKILL);
    (void)abbed_->wait_for_end();
  }
  /// abbed continues, and is stopped in the way of systemd.
  void kill_abbe_dds() {
    look_on(some_moment(kWholeRun / 2));
    pid_t child = 0;
    for (const auto& thread : fs::directory_iterator(fmt::format("/proc/{}/task", abbed_->pid())))
      if (std::ifstream{thread.path() / "children"} >> child) break;
    if (child > 0) (void)::kill(child, SIGKILL);
    simulator_->signal(SIGCONT);
    EXPECT_TRUE(goes_on("encoder"));
    note(status());
    recorded_ = 0;  // a clean end renames its file
    EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
  }
  void kill_abbe_model() {
    if (models_.empty()) return kill_abbed();
    Program command({ABBE_PROGRAM, "model", "activate", *models_.begin(), "--force", "--why",
                     "kills", "-c", file("abbed.toml")},
                    directory_ / "model");
    (void)::usleep(
        static_cast<useconds_t>(1000 * some_moment(std::chrono::milliseconds{60}).count()));
    command.signal(SIGKILL);
    (void)command.wait_for_end();
    note(status());
    kill_abbed();
  }

  unsigned seed_;
  std::mt19937 random_;
  std::unique_ptr<Program> calibration_;
  std::set<std::string> models_;               // that abbed has reported as stored
  std::map<std::string, std::uint64_t> left_;  // messages by the name a file is to get
  std::uint64_t recorded_ = 0;                 // in finished chunks, as abbed last reported
  std::string recording_;
};

TEST_F(Kills, LoseNothingThatWasFinishedAndLeaveNothingBehind) {
  const unsigned rounds = number_from("ABBE_KILLS", 4);
  for (unsigned round = 0; round < rounds && !HasFailure(); ++round) {
    SCOPED_TRACE(fmt::format("round {} of seed {}", round, seed_));
    ASSERT_NO_FATAL_FAILURE(begin_round());
    expect_no_leftovers();
    switch (one_of(4)) {
      case 0:
        kill_abbe_model();
        break;
#ifdef ABBE_WITH_DDS
      case 1:
        kill_abbe_dds();
        break;
#endif
      default:
        kill_abbed();
    }
    expect_chunks();
    expect_models();
    recorded_ = 0;
    calibration_.reset();
    simulator_.reset();
    if (round % 10 == 9)
      fmt::print("kills: {} of {}, {} models\n", round + 1, rounds, models_.size());
  }

  ASSERT_NO_FATAL_FAILURE(begin_round());
  expect_no_leftovers();
  fmt::print(
      "figure: kills: {} of abbed, abbe-dds and `abbe model`: 0 finished chunks, 0 of {} models "
      "lost, every "
      "leftover closed (asked: 500, 0, 0)\n",
      rounds, models_.size());
}

}  // namespace
}  // namespace abbe::test
