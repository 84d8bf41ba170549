// The configuration in a recording: values that a limit of later versions refuses remain readable.

#include <gmock/gmock.h>

#include <string>

#include "abbe/replay/replay.hpp"
#include "config_fixture.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using ::testing::IsEmpty;
using ::testing::Not;

/// An axis of 0.3 mm, steps of 10 mm, a host that no resolver accepts.
std::string implausible() {
  std::string text = kMachine;
  text.replace(text.find("max_mm = 300"), 12, "max_mm = -299.7");
  return text + kCanBus +
         "nodes = [{axis = \"X\", node = 1, step_nm = 1e7}, {axis = \"Y\", node = 2},\n"
         "  {axis = \"Z\", node = 3}]\n[tracker]\nhost = \"192.168.0.300\"\n";
}

TEST(RecordedConfig, IsReadWithValuesThatNoMachineHas) {
  EXPECT_THAT(faults_of(implausible()), Not(IsEmpty()));
  const auto config = parse_recorded_config(implausible(), "recorded");
  ASSERT_TRUE(config) << ::testing::PrintToString(config.error().details);
  EXPECT_NEAR(config->machine.axes[0].max, -0.2997, 1e-12);
  EXPECT_EQ(config->of<EncoderConfig>()->nodes[0].step, 0.01);
}

TEST(RecordedConfig, WithAnUnknownKeyIsRefused) {
  EXPECT_FALSE(parse_recorded_config(implausible() + "hots = 1\n", "recorded"));
}

TEST(RecordedConfig, OfARecordingIsReadWithValuesThatNoMachineHas) {
  TemporaryFolder folder;
  auto info = example_info();
  info.configuration = implausible();
  {
    auto recorder = Recorder::open(example_options(folder.path()), info, Recorder::WallTime{});
    ASSERT_TRUE(recorder) << recorder.error().text;
    recorder->record(example_axes(0), "encoder");  // a recording without a message is removed
    ASSERT_TRUE(recorder->close());
  }

  const auto reader = RecordingReader::open(folder.path() / "run.mcap");
  ASSERT_TRUE(reader) << reader.error().text;
  EXPECT_TRUE(recorded_config(*reader, "run.mcap"));
}

}  // namespace
}  // namespace abbe::daemon
