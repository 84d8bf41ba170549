#include <gmock/gmock.h>

#include <string>

#include "counter_card_run.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

TEST_F(CounterCardRun, StreamsRecordsAndReportsItsAssumptions) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_both());
  ASSERT_TRUE(eventually([&] { return samples("counter_card") > 1000; })) << status().dump(1);
  EXPECT_EQ(stream("counter_card")["state"], "streaming");
  EXPECT_TRUE(goes_on("counter_card"));
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
  EXPECT_THAT(abbed_->err(), HasSubstr("not yet verified on hardware"));
  ASSERT_EQ(recordings().size(), 1u);
  EXPECT_EQ(recordings().front().extension(), ".mcap");
}

TEST_F(CounterCardRun, IsRefusedByNameWithAnImpossibleWiring) {
  write_card_configuration(wiring("port = 3240\nclock_channel = 1\n"));
  const auto checked = run({ABBED_PROGRAM, "--check-config", "-c", file("abbed.toml")});
  EXPECT_NE(checked.code, 0);
  EXPECT_THAT(checked.out + checked.err, HasSubstr("channel 1 is claimed by axis Y and the clock"));
}

}  // namespace
}  // namespace abbe::test
