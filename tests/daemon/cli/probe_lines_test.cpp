// `abbe probe-lines`, as people use it, with a simulated tracker that prints lines.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <string>
#include <thread>

#include "abbe/config/config.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/sim/line_tracker_server.hpp"
#include "abbe_command.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using protocol::lines::Column;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

sim::VirtualMachine machine_at_rest() {
  sim::PathPlan plan;
  plan.vertices = {{{0.1, 0.2, -0.3}}};
  return {sim::TruthMachine{}, sim::PathMotion::plan(plan).value()};
}

/// A tracker that prints its points on a transport, on a thread of its own.
class PrintingTracker {
 public:
  PrintingTracker(const sim::LineOutput& output, std::initializer_list<Column> columns,
                  char separator = ' ') {
    sim::LineTrackerOptions options;
    for (const Column column : columns)
      options.format.columns[options.format.column_count++] = column;
    options.format.separator = separator;
    server_.emplace(
        sim::LineTrackerServer::open(
            output, std::make_unique<sim::LineTracker>(options, machine_, time_.now()), time_.now())
            .value());
    thread_ = std::thread([this] {
      while (!stop_) {
        server_->poll(time_.now());
        std::this_thread::sleep_for(2ms);
      }
    });
  }
  ~PrintingTracker() {
    stop_ = true;
    thread_.join();
  }
  PrintingTracker(const PrintingTracker&) = delete;
  PrintingTracker& operator=(const PrintingTracker&) = delete;
  [[nodiscard]] std::uint16_t port() const { return server_->port(); }

 private:
  drivers::MonotonicTime time_;
  sim::VirtualMachine machine_ = machine_at_rest();
  std::optional<sim::LineTrackerServer> server_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

class ProbeLines : public testing::Test {
 protected:
  ProbeLines() {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~ProbeLines() override { fs::remove_all(folder_); }

  [[nodiscard]] test::Ran probe(const std::string& arguments) const {
    return test::run_abbe(folder_, "probe-lines --duration-s 2 --wait-s 5 " + arguments);
  }
  [[nodiscard]] std::string text_of_out() const { return test::text_of(folder_ / "tracker.toml"); }
  /// The faults of a whole configuration with the table that was written.
  [[nodiscard]] std::string faults() const {
    const std::string machine = test::text_of(fs::path(ABBE_SOURCE_FOLDER) / "demo/machine.toml");
    const auto config =
        parse_config(machine.substr(0, machine.find("[tracker]")) + text_of_out(), "abbed.toml");
    return config ? "" : testing::PrintToString(config.error().details);
  }

  const fs::path folder_ =
      fs::path(testing::TempDir()) /
      (std::string{"probe_lines_"} + testing::UnitTest::GetInstance()->current_test_info()->name());
};

constexpr std::initializer_list<Column> kTimeXyzStatus{Column::Time, Column::X, Column::Y,
                                                       Column::Z, Column::Status};
const std::string kStated =
    " --columns time,x,y,z,status --valid-status 1 --length-unit mm --weather compute "
    "--frame tracker --time-unit s --point-rate-hz 500 ";

TEST_F(ProbeLines, ShowsWhatItReceivesAndAsksForTheRest) {
  const PrintingTracker tracker{{}, kTimeXyzStatus};
  const auto ran = probe(fmt::format("--host 127.0.0.1 --port {}", tracker.port()));
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, AllOf(HasSubstr("5 columns, separator space"),
                             HasSubstr("by 0.002 from line to line"), HasSubstr("--length-unit"),
                             HasSubstr("--frame tracker"), HasSubstr("\"1\" (")));
  EXPECT_THAT(ran.out, Not(HasSubstr("understood")));
}

TEST_F(ProbeLines, WritesATableThatTheDaemonReads) {
  const PrintingTracker tracker{{}, kTimeXyzStatus};
  const auto ran =
      probe(fmt::format("--host 127.0.0.1 --port {}{}-o tracker.toml", tracker.port(), kStated));
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, AllOf(HasSubstr("understood"), HasSubstr("0 lines cannot be read")));
  EXPECT_THAT(text_of_out(), AllOf(HasSubstr("point_rate_hz = 500"), HasSubstr("time_unit = \"s\""),
                                   HasSubstr("separator = \"space\"")));
  EXPECT_EQ(faults(), "");
}

TEST_F(ProbeLines, ReceivesDatagramsAndSendersThatConnect) {
  for (const auto transport : {sim::LineTransport::Udp, sim::LineTransport::TcpServer}) {
    std::uint16_t port = 0;
    {
      const auto free = sim::listen_tcp(0).value();
      port = sim::port_of(free);
    }
    const PrintingTracker tracker{{transport, port, {}},
                                  {Column::Range, Column::Azimuth, Column::Elevation, Column::Time},
                                  ';'};
    const bool udp = transport == sim::LineTransport::Udp;
    const auto ran = probe(fmt::format(
        "--transport {} --host 127.0.0.1 --port {} --columns range,azimuth,elevation,time "
        "--length-unit mm --angle-unit rad --time-unit s --point-rate-hz 500 --weather none "
        "--frame tracker -o tracker.toml "
        "--replace",
        udp ? "udp" : "tcp-server", port));
    EXPECT_EQ(ran.exit, 0) << ran.err << ran.out;
    EXPECT_THAT(text_of_out(), HasSubstr("separator = \"semicolon\""));
    EXPECT_EQ(faults(), "");
  }
}

TEST_F(ProbeLines, ReadsASerialLine) {
  const auto link = (folder_ / "tty").string();
  const PrintingTracker tracker{{sim::LineTransport::Serial, 0, link}, kTimeXyzStatus};
  const auto ran = probe("--transport serial --serial tty" + kStated + "-o tracker.toml");
  EXPECT_EQ(ran.exit, 0) << ran.err << ran.out;
  EXPECT_THAT(text_of_out(), HasSubstr("serial = \"tty\""));
}

TEST_F(ProbeLines, ReplacesNoFileUnlessItIsToldTo) {
  const PrintingTracker tracker{{}, kTimeXyzStatus};
  test::write_text(folder_ / "tracker.toml", "mine\n");
  const auto arguments =
      fmt::format("--host 127.0.0.1 --port {}{}-o tracker.toml", tracker.port(), kStated);
  const auto ran = probe(arguments);
  EXPECT_EQ(ran.exit, 5);
  EXPECT_THAT(ran.err, HasSubstr("--replace"));
  EXPECT_EQ(text_of_out(), "mine\n");
  EXPECT_EQ(probe(arguments + " --replace").exit, 0);
  EXPECT_THAT(text_of_out(), HasSubstr("protocol = \"lines\""));
}

TEST_F(ProbeLines, WritesNothingWhileAnythingIsMissing) {
  const PrintingTracker tracker{{}, kTimeXyzStatus};
  const auto ran = probe(fmt::format(
      "--host 127.0.0.1 --port {} --columns time,x,y,z,status -o tracker.toml", tracker.port()));
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("--valid-status"), HasSubstr("--length-unit")));
  EXPECT_FALSE(fs::exists(folder_ / "tracker.toml"));
}

TEST_F(ProbeLines, WritesNoTableThatTheLinesContradict) {
  const PrintingTracker tracker{{}, kTimeXyzStatus};
  const auto of =
      fmt::format("--host 127.0.0.1 --port {}{}-o tracker.toml", tracker.port(), kStated);
  const auto replaced = [&](const std::string& stated, const std::string& wrong) {
    std::string arguments = of;
    return probe(arguments.replace(arguments.find(stated), stated.size(), wrong));
  };
  const auto unit = replaced("--time-unit s", "--time-unit ms"),
             rate = replaced("--point-rate-hz 500", "--point-rate-hz 1000"),
             status = replaced("--valid-status 1", "--valid-status 7");
  EXPECT_EQ(unit.exit, 1);
  EXPECT_THAT(unit.err, HasSubstr("column 1 advances as a time in s, stated is ms"));
  EXPECT_EQ(rate.exit, 1);
  EXPECT_THAT(rate.err, HasSubstr("1000 points per second are stated, the time column shows 500"));
  EXPECT_EQ(status.exit, 1);
  EXPECT_THAT(status.err, HasSubstr("every point is invalid by its status"));
  EXPECT_FALSE(fs::exists(folder_ / "tracker.toml"));
}

TEST_F(ProbeLines, ReportsColumnsThatDoNotFit) {
  const PrintingTracker tracker{{}, kTimeXyzStatus};
  const auto ran =
      probe(fmt::format("--host 127.0.0.1 --port {} --columns time,x,y,z "
                        "--length-unit mm --weather none --frame tracker",
                        tracker.port()));
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, HasSubstr("column 5"));
  EXPECT_THAT(ran.out, HasSubstr("4 columns are stated, the lines have 5"));
}

TEST_F(ProbeLines, FailsIfNobodyListensOrSends) {
  const auto free = sim::listen_tcp(0).value();
  const auto port = sim::port_of(free);
  const auto silent = probe(fmt::format("--host 127.0.0.1 --port {}", port));
  EXPECT_EQ(silent.exit, 4);
  EXPECT_THAT(silent.err, HasSubstr(fmt::format("127.0.0.1:{}: no line in", port)));
  EXPECT_EQ(probe("--host 127.0.0.1 --port 1").exit, 4);
}

TEST_F(ProbeLines, RefusesAnAddressThatIsIncomplete) {
  EXPECT_EQ(probe("--port 7001").exit, 2);
  EXPECT_EQ(probe("--transport serial --host 127.0.0.1 --serial tty").exit, 2);
}

TEST_F(ProbeLines, EndsAtCtrlCWithWhatItReceived) {
  const PrintingTracker tracker{{}, kTimeXyzStatus};
  const auto command = fmt::format(
      "probe-lines --duration-s 100 --host 127.0.0.1 --port {} & sleep 2; kill -INT $!; wait $!",
      tracker.port());
  const auto ran = test::run_abbe(folder_, "--version >/dev/null; '" ABBE_PROGRAM "' " + command);
  EXPECT_EQ(ran.exit, 130);
}

}  // namespace
}  // namespace abbe::daemon
