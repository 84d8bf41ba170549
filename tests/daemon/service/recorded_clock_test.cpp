// A wall clock that was set while abbed recorded.
#include "abbe/recording/recorded_clock.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <thread>

#include "abbe/base/control_protocol.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/service/abbed.hpp"
#include "abbe_command.hpp"
#include "recording_fixture.hpp"
#include "synthetic_otf_recording.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr std::chrono::nanoseconds k200Days = 24h * 200;

RecordedClock clock_of(const std::vector<RecordingAttachment>& attachments) {
  const TemporaryFolder folder;
  auto recorder = Recorder::open(example_options(folder.path()), example_info(), {});
  EXPECT_TRUE(recorder) << recorder.error().text;
  recorder->record(example_point(0), "tracker");
  for (const auto& attachment : attachments) recorder->attach(attachment, example_time(1));
  const auto closed = recorder->close();
  EXPECT_TRUE(closed) << closed.error().text;
  return recorded_clock(RecordingReader::open(closed->file).value());
}

TEST(RecordedClock, DatesAreThoseOfTheStartUnlessTheClockWasSet) {
  EXPECT_EQ(clock_of({}).dates.value, kOffset.value);
  const auto set =
      clock_of({to_attachment({.step = 5min}), to_attachment({.step = k200Days, .suspended = 3h})});
  EXPECT_EQ(set.dates.value, kOffset.value + k200Days + 3h);
  EXPECT_EQ(set.change.step, k200Days);
  EXPECT_EQ(set.change.suspended, 3h);
  EXPECT_EQ(clock_of({to_attachment({.step = -k200Days})}).dates.value, kOffset.value - k200Days);
}

TEST(RecordedClock, IgnoresAnAttachmentThatIsNoChange) {
  for (const char* text : {"", "[]", "{\"step_ns\": 1}", "{\"step_ns\": 1.5, \"suspended_ns\": 0}"})
    EXPECT_EQ(clock_of({{std::string{kClockChangeName}, "application/json", text}}).dates.value,
              kOffset.value)
        << text;
}

TEST(RecordedClock, AModelOfTheRecordingHasTheDatesAfterTheChangeAndANote) {
  const TemporaryFolder folder;
  const auto identified = [&](std::optional<ClockChange> change, const std::string& name) {
    std::filesystem::create_directory(folder.path() / name);
    (void)test::record_synthetic_run(folder.path() / name, std::nullopt, change);
    const auto ran =
        test::run_abbe(folder.path(), "identify otf --recording " + name + "/run.mcap -o " + name);
    EXPECT_TRUE(ran.exit == 0 || ran.exit == 5) << ran.err;
    return read_model(folder.path() / name / "model.json").value();
  };
  const ModelDocument plain = identified(std::nullopt, "plain"),
                      set = identified(ClockChange{.step = k200Days}, "set");
  EXPECT_EQ(model_hash(plain), model_hash(set));
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_EQ((*set.run->conditions->measured)[i],
              (*plain.run->conditions->measured)[i] + k200Days);
  EXPECT_THAT(set.verdict->notes, Contains(HasSubstr("was set forward by 200 d 0 h since abbed")));
  EXPECT_THAT(plain.verdict->notes, testing::Not(Contains(HasSubstr("was set"))));
}

/// The clocks of abbed are those of the test, which sets them while abbed runs.
TEST(RecordedClock, AbbedReportsAndRecordsAClockThatIsSetWhileItRuns) {
  const TemporaryFolder folder;
  Config config;
  config.machine.name = "mill";
  config.daemon.data_dir = config.daemon.runtime_dir = folder.path();
  config.recording.dir = folder.path() / "recordings";
  config.recording.min_free_bytes = 0;
  config.control.socket = folder.path() / "control.sock";
  config.dds.socket = folder.path() / "dds.sock";
  config.dds.supervise = Supervise::Off;
  std::atomic<std::chrono::nanoseconds> set{};
  const WallClock clock{[&set] {
    ClockReading now = read_clocks();
    now.utc += set.load();
    return now;
  }};
  const auto abbed = Abbed::start(config, {.clock = clock});
  ASSERT_TRUE(abbed) << abbed.error().text;
  const auto status = [&] { return ask_daemon(config.control.socket, {{"do", "status"}}).value(); };
  (*abbed)->cycle();
  EXPECT_FALSE(status().contains("clock"));

  set = -k200Days;
  testing::internal::CaptureStderr();
  (*abbed)->cycle();
  (*abbed)->cycle();
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_THAT(log, HasSubstr("abbed: the wall clock was set backward by 200 d 0 h"));
  EXPECT_EQ(log.find("backward"), log.rfind("backward")) << "reported once";
  EXPECT_THAT(status()["clock"].dump(), HasSubstr("set backward by 200 d 0 h"));
  const std::filesystem::path recording = status().at("recording").get<std::string>();
  while (test::text_of(recording).find(kClockChangeName) == std::string::npos)
    std::this_thread::yield();  // the recorder is a thread of its own
}

}  // namespace
}  // namespace abbe::daemon
