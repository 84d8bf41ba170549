/// Orders to a tracker, and the result shown for orders without a report.

#include "abbe/service/tracker_service.hpp"

#include <gmock/gmock.h>

#include <utility>
#include <vector>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using drivers::TrackerOrder;
using drivers::TrackerOrderReport;
using ::testing::HasSubstr;
using Outcome = TrackerOrderReport::Outcome;

constexpr protocol::HostTime kBegin{100s};

/// Of a tracker's thread: what was ordered, and the reports a test puts there.
struct TrackerThread final : SampleSource {
  void drain(Batch&) override {}
  std::vector<StreamHealth> health(protocol::HostTime) override { return {}; }
  std::optional<drivers::DeviceStatus> tracker_status() const override {
    return drivers::DeviceStatus{.name = "tracker", .state = "streaming", .connected = true};
  }
  void order_tracker(TrackerOrder order) override { ordered.push_back(std::move(order)); }
  std::vector<TrackerOrderReport> tracker_reports() override { return std::exchange(reports, {}); }
  std::vector<TrackerOrder> ordered;
  std::vector<TrackerOrderReport> reports;
};

class TrackerOrders : public ::testing::Test {
 protected:
  Result<std::uint64_t> home() {
    return service_.start({.what = TrackerOrder::What::GoHome}, {.by = "anna", .now = kBegin});
  }
  TrackerThread thread_;
  TrackerService service_{thread_, 10s};
};

TEST_F(TrackerOrders, AreUnderWayUntilTheyAreReported) {
  ASSERT_TRUE(home());
  service_.cycle(kBegin + 1s);
  ASSERT_NE(service_.running(), nullptr);
  EXPECT_EQ(service_.running()->by, "anna");
  EXPECT_THAT(home().error().text, HasSubstr("\"home\" of anna is under way"));
  thread_.reports = {
      {.number = thread_.ordered[0].number, .outcome = Outcome::Done, .text = "there"}};
  service_.cycle(kBegin + 2s);
  EXPECT_EQ(service_.running(), nullptr);
  EXPECT_EQ(service_.orders().back().report->text, "there");
}

TEST_F(TrackerOrders, WithoutAReportFailAndALateReportIsStillUsed) {
  ASSERT_TRUE(home());
  service_.cycle(kBegin + 10s);
  EXPECT_NE(service_.running(), nullptr);
  service_.cycle(kBegin + 10s + 1ms);
  ASSERT_EQ(service_.running(), nullptr);
  EXPECT_EQ(service_.orders().back().report->outcome, Outcome::Failed);
  EXPECT_THAT(service_.orders().back().report->text, HasSubstr("no report in 10 s"));
  thread_.reports = {
      {.number = thread_.ordered[0].number, .outcome = Outcome::Done, .text = "there"}};
  service_.cycle(kBegin + 20s);
  EXPECT_EQ(service_.orders().back().report->outcome, Outcome::Done);
}

TEST_F(TrackerOrders, TheLatestAreKept) {
  for (std::size_t i = 0; i < TrackerService::kKept + 2; ++i) {
    ASSERT_TRUE(home());
    thread_.reports = {{.number = thread_.ordered.back().number, .outcome = Outcome::Done}};
    service_.cycle(kBegin);
  }
  EXPECT_EQ(service_.orders().size(), TrackerService::kKept);
  EXPECT_EQ(service_.orders().front().asked.number, 3u);
  thread_.reports = {{.number = 1, .outcome = Outcome::Refused}};  // of an order that is not kept
  service_.cycle(kBegin);
  EXPECT_EQ(service_.orders().back().report->outcome, Outcome::Done);
}

}  // namespace
}  // namespace abbe::daemon
