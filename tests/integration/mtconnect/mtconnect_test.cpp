/// abbe-mtconnect between a real abbed with simulated devices and agents over TCP.

#include <gmock/gmock.h>
#include <signal.h>
#include <tinyxml2.h>

#include <regex>
#include <set>

#include "abbe/calib/iso/standard_values.hpp"
#include "mtconnect_adapter.hpp"
#include "shdr_client.hpp"

namespace abbe::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Key;

class Mtconnect : public MtconnectAdapter {
 protected:
  void connect() {
    agent_ = std::make_unique<ShdrClient>(listening_port());
    ASSERT_TRUE(agent_->connected());
  }
  /// Reads until `seen` holds for what the agent shows.
  template <class Condition>
  bool agent_sees(Condition seen) {
    return eventually([&] {
      EXPECT_TRUE(agent_->read(10ms)) << adapter_->err();
      return seen(agent_->view()) || testing::Test::HasFailure();
    });
  }
  bool agent_sees(const std::string& name, const std::string& value) {
    return agent_sees([&](const ShdrView& view) {
      const auto found = view.events.find(name);
      return found != view.events.end() && found->second == value;
    });
  }
  /// Waits for a value of the data item.
  std::string value_of(const std::string& name) {
    EXPECT_TRUE(agent_sees([&](const ShdrView& view) {
      const auto found = view.events.find(name);
      return found != view.events.end() && found->second != "UNAVAILABLE";
    })) << name;
    return agent_->view().events.at(name);
  }
  bool agent_sees_level(const std::string& condition, const std::string& level) {
    return agent_sees([&](const ShdrView& view) { return view.level(condition) == level; });
  }
  std::unique_ptr<ShdrClient> agent_;
};

TEST_F(Mtconnect, ShowsADeviceThatFails) {
  write_path("path.csv", path());
  start_simulator();
  configure();
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(connect());

  EXPECT_TRUE(agent_sees("avail", "AVAILABLE"));
  EXPECT_TRUE(agent_sees_level("devices", "NORMAL")) << status().dump(1);
  EXPECT_TRUE(agent_sees("model_state", "NONE"));
  EXPECT_EQ(agent_->view().events.at("model_id"), "UNAVAILABLE");
  EXPECT_EQ(agent_->view().events.at("process_state"), "READY");
  simulator_->signal(SIGKILL);
  EXPECT_TRUE(agent_sees(
      [](const ShdrView& view) { return view.conditions.at("devices").contains("tracker"); }));
  EXPECT_EQ(agent_->view().conditions.at("devices").at("tracker").level, "FAULT");
  EXPECT_THAT(agent_->view().conditions.at("devices").at("tracker").text,
              HasSubstr(std::to_string(tracker_port_)));
}

TEST_F(Mtconnect, ShowsACalibrationUntilItsModelIsActive) {
  write_path("path.csv", path());
  start_simulator();
  hold_simulator();
  configure();
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(connect());
  EXPECT_TRUE(agent_sees("process_state", "READY"));
  EXPECT_EQ(agent_->view().events.at("process_id"), "UNAVAILABLE");
  const auto calibration = calibrate("path.csv");
  ASSERT_EQ(calibration.code, 0) << calibration.err;

  EXPECT_TRUE(agent_sees("process_state", "COMPLETE"));
  const auto model = status()["model"];
  EXPECT_EQ(agent_->view().events.at("model_id"), model["id"]);
  EXPECT_EQ(agent_->view().events.at("model_date"), model["created"]);
  EXPECT_EQ(agent_->view().events.at("process_kind"), "otf");
  EXPECT_GT(std::stod(value_of("u_volume")), 0.0);
}

TEST_F(Mtconnect, StatesTheActiveModelAndItsUncertainty) {
  configure();
  const auto document = activate_a_model();
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(connect());

  EXPECT_TRUE(agent_sees("model_id", daemon::model_id(document)));
  EXPECT_TRUE(agent_sees("model_hash", daemon::model_hash(document)));
  EXPECT_TRUE(agent_sees("model_date", status()["model"]["created"]));
  // U(V) of the report has k = 2 and is in m; the data item has seven decimals of mm.
  const auto volume = calib::iso::volume_error(document.model).value();
  EXPECT_NEAR(std::stod(value_of("u_volume")), volume.max_U_m / 2.0 * 1e3, 5e-8);
  EXPECT_GT(volume.max_U_m, 0.0);
  EXPECT_EQ(value_of("u_type"), "COMBINED");
  EXPECT_THAT(agent_->view().conditions.at("calibration"), Contains(Key("MODEL_STALE")))
      << "no device has reported axis positions";
}

TEST_F(Mtconnect, IsUnavailableWhileTheDaemonIsAway) {
  configure();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(connect());
  EXPECT_TRUE(agent_sees("avail", "UNAVAILABLE"));
  EXPECT_TRUE(eventually(
      [this] { return adapter_->err().find("is abbed running?") != std::string::npos; }));
  start_abbed();
  EXPECT_TRUE(agent_sees("avail", "AVAILABLE"));
  EXPECT_TRUE(agent_sees_level("devices", "FAULT"));

  abbed_->signal(SIGKILL);
  EXPECT_TRUE(agent_sees("avail", "UNAVAILABLE"));
  EXPECT_TRUE(agent_sees_level("devices", "UNAVAILABLE"));
  start_abbed();
  EXPECT_TRUE(agent_sees("avail", "AVAILABLE"));
}

/// SIGSTOP: abbed accepts the connection and never answers.
TEST_F(Mtconnect, KeepsItsHeartbeatWhileTheDaemonHangs) {
  configure();
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(connect());
  EXPECT_TRUE(agent_sees("avail", "AVAILABLE"));
  abbed_->signal(SIGSTOP);
  EXPECT_TRUE(agent_sees("avail", "UNAVAILABLE"));

  const auto before = agent_->view().commands.size();
  const auto asked = std::chrono::steady_clock::now();
  ASSERT_TRUE(agent_->send("* PING\n"));
  EXPECT_TRUE(agent_sees([&](const ShdrView& view) { return view.commands.size() > before; }));
  EXPECT_LT(std::chrono::steady_clock::now() - asked, 1500ms) << "the configured heartbeat";
  EXPECT_EQ(agent_->view().commands.back(), "* PONG 1500");
  abbed_->signal(SIGCONT);
  EXPECT_TRUE(agent_sees("avail", "AVAILABLE"));
}

TEST_F(Mtconnect, ShowsARefusedCalibration) {
  configure();
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(connect());
  write_path("path.csv", path());
  Program calibration(
      {ABBE_PROGRAM, "calibrate", "otf", "-c", file("abbed.toml"), "--path", file("path.csv")},
      directory_ / "calibrate");
  EXPECT_TRUE(agent_sees("process_kind", "otf"));
  EXPECT_EQ(run({ABBE_PROGRAM, "calibrate", "otf", "-c", file("abbed.toml"), "--cancel"}).code, 0);

  EXPECT_TRUE(agent_sees("process_state", "ABORTED"));
  EXPECT_TRUE(agent_sees([](const ShdrView& view) {
    for (const auto& [code, raised] : view.conditions.at("calibration"))
      if (code.starts_with("REFUSED_")) return raised.level == "WARNING";
    return false;
  }));
  EXPECT_THAT(agent_->view().events.at("message"), HasSubstr("cancelled by"));
}

/// What the agent cannot find in its file it ignores.
TEST_F(Mtconnect, SendsTheDataItemsOfTheExampleFile) {
  configure();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(connect());
  ASSERT_TRUE(agent_sees_level("system", "UNAVAILABLE"));
  tinyxml2::XMLDocument devices;
  ASSERT_EQ(devices.LoadFile(ABBE_DEVICES_XML), tinyxml2::XML_SUCCESS);
  tinyxml2::XMLPrinter printer;
  devices.Print(&printer);

  std::set<std::string> named, sent;
  const std::string text = printer.CStr();
  const std::regex item{"<DataItem [^>]* name=\"([a-z_]+)\""};
  for (std::sregex_iterator it(text.begin(), text.end(), item), end; it != end; ++it)
    named.insert((*it)[1]);
  EXPECT_TRUE(agent_sees([&](const ShdrView& view) { return view.lines_of.contains("u_volume"); }));
  for (const auto& [name, count] : agent_->view().lines_of) sent.insert(name);
  EXPECT_EQ(sent, named);
}

TEST_F(Mtconnect, EndsWithAClearErrorIfThePortIsInUse) {
  configure();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  const auto second = run({ABBE_MTCONNECT_PROGRAM, "--socket", file("run/control.sock"), "--port",
                           std::to_string(listening_port())});
  EXPECT_EQ(second.code, 4);
  EXPECT_THAT(second.err, AllOf(HasSubstr("port " + std::to_string(listening_port())),
                                HasSubstr("another process listens there")));
  EXPECT_TRUE(adapter_->running());
  EXPECT_EQ(adapter_->stop(), 0);
}

TEST_F(Mtconnect, RefusesAFaultyConfigurationWithTheKey) {
  tracker_port_ = can_port_ = 1;
  write_configuration();
  write("abbed.toml", text_of(file("abbed.toml")) +
                          "[mtconnect]\naddress = \"localhost\"\nport = 70000\nheart = 1\n");
  const auto refused = run({ABBE_MTCONNECT_PROGRAM, "--config", file("abbed.toml")});
  EXPECT_EQ(refused.code, 3);
  for (const char* key : {"mtconnect.address", "mtconnect.port", "mtconnect.heart"})
    EXPECT_THAT(refused.err, HasSubstr(key));
  EXPECT_EQ(run({ABBED_PROGRAM, "--check-config", "--config", file("abbed.toml")}).code, 3);
}

TEST_F(Mtconnect, WarnsIfTheNetworkCanReadIt) {
  configure();
  adapter_ = start({ABBE_MTCONNECT_PROGRAM, "--address", "0.0.0.0", "--port", "0"}, "mtconnect");
  EXPECT_TRUE(eventually([this] {
    return adapter_->err().find("every computer that reaches this address") != std::string::npos;
  }));
}

}  // namespace
}  // namespace abbe::test
