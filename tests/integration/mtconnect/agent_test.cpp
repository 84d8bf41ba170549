/// abbe-mtconnect with a real MTConnect agent (cppagent 2), which the environment variable
/// ABBE_MTCONNECT_AGENT names; skipped without it. README.md explains how to get one.

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <tinyxml2.h>
#include <unistd.h>

#include <cstdlib>
#include <functional>
#include <vector>

#include "mtconnect_adapter.hpp"

// After Eigen, which uses a name that <resolv.h> defines as a macro.
#include <httplib.h>

namespace abbe::test {
namespace {

using testing::HasSubstr;

/// A TCP port that is free now; another program may have it a moment later.
std::uint16_t free_port() {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* const any = reinterpret_cast<sockaddr*>(&address);
  EXPECT_EQ(::bind(fd, any, size), 0);
  EXPECT_EQ(::getsockname(fd, any, &size), 0);
  ::close(fd);
  return ntohs(address.sin_port);
}

/// One observation of a data item in a document of the agent.
struct Observation {
  std::string element;  ///< "ProcessState", "x:ModelState"; of a condition "Normal", "Fault", ...
  std::string native_code;
  std::string text;
};

class MtconnectAgent : public MtconnectAdapter {
 protected:
  void SetUp() override {
    const char* const program = std::getenv("ABBE_MTCONNECT_AGENT");
    if (program == nullptr)
      GTEST_SKIP() << "ABBE_MTCONNECT_AGENT does not name an agent (tests/integration/mtconnect/"
                      "README.md)";
    program_ = program;
  }

  /// agent.cfg is that of daemon/docs/mtconnect.md with other ports, at 127.0.0.1 only.
  void start_agent() {
    port_ = free_port();
    write("Devices.xml", text_of(ABBE_DEVICES_XML));
    write("agent.cfg", fmt::format(R"(Devices = Devices.xml
Port = {}
ServerIp = 127.0.0.1
UpcaseDataItemValue = false
Adapters {{
  abbe {{
    Device = machine
    Host = 127.0.0.1
    Port = {}
  }}
}}
StreamsNamespaces {{
  x {{
    Urn = urn:abbe:abbe-mtconnect:1.0
  }}
}}
)",
                                   port_, listening_port()));
    agent_ = start({"/bin/sh", "-c", R"(cd "$1" && exec "$2" run agent.cfg)", "sh",
                    directory_.string(), program_},
                   "agent");
    ASSERT_TRUE(eventually([this] { return !get("/current").empty() || !agent_->running(); }));
    ASSERT_TRUE(agent_->running()) << agent_->out() << agent_->err();
  }

  /// The document at `path`; empty: none.
  [[nodiscard]] std::string get(const std::string& path) const {
    httplib::Client client("127.0.0.1", port_);
    const auto answer = client.Get(path);
    return answer && answer->status == 200 ? answer->body : std::string{};
  }

  /// What /current shows of the data item.
  [[nodiscard]] std::vector<Observation> observations(const std::string& name) const {
    std::vector<Observation> found;
    tinyxml2::XMLDocument document;
    if (document.Parse(get("/current").c_str()) != tinyxml2::XML_SUCCESS) return found;
    const std::function<void(const tinyxml2::XMLElement*)> look = [&](const auto* element) {
      for (; element != nullptr; element = element->NextSiblingElement()) {
        const auto of = [element](const char* attribute) {
          const char* const value = element->Attribute(attribute);
          return std::string{value != nullptr ? value : ""};
        };
        // A component has a name, too, but only an observation belongs to a data item.
        if (of("name") == name && !of("dataItemId").empty())
          found.push_back({element->Name(), of("nativeCode"),
                           element->GetText() != nullptr ? element->GetText() : ""});
        look(element->FirstChildElement());
      }
    };
    look(document.RootElement());
    return found;
  }
  bool agent_shows(const std::string& name, const std::string& text) {
    return eventually([&] {
      const auto seen = observations(name);
      return !seen.empty() && seen.front().text == text;
    });
  }
  bool agent_shows_condition(const std::string& name, const std::string& level,
                             const std::string& native_code) {
    return eventually([&] {
      for (const Observation& o : observations(name))
        if (o.element == level && o.native_code == native_code) return true;
      return false;
    });
  }

  std::string program_;
  std::uint16_t port_ = 0;
  std::unique_ptr<Program> agent_;
};

TEST_F(MtconnectAgent, ShowsModelConditionsAndTheLossOfTheDaemon) {
  configure();
  const auto document = activate_a_model();
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(start_agent());

  EXPECT_TRUE(agent_shows("avail", "AVAILABLE")) << agent_->err();
  EXPECT_TRUE(agent_shows("model_id", daemon::model_id(document)));
  EXPECT_TRUE(agent_shows("model_hash", daemon::model_hash(document)));
  EXPECT_TRUE(agent_shows("model_date", status()["model"]["created"]));
  EXPECT_TRUE(agent_shows("model_state", "STALE"));
  EXPECT_TRUE(agent_shows("process_state", "READY"));
  EXPECT_GT(std::stod(observations("u_volume").at(0).text), 0.0);
  EXPECT_TRUE(agent_shows_condition("calibration", "Warning", "MODEL_STALE"));
  EXPECT_TRUE(agent_shows_condition("devices", "Fault", "tracker"));

  abbed_->signal(SIGKILL);
  EXPECT_TRUE(agent_shows("avail", "UNAVAILABLE"));
  start_abbed();
  EXPECT_TRUE(agent_shows("avail", "AVAILABLE"));
}

TEST_F(MtconnectAgent, ShowsARefusedCalibrationWithItsReason) {
  configure();
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(start_agent());
  ASSERT_TRUE(agent_shows("process_state", "READY")) << agent_->err();
  write_path("path.csv", path());
  Program calibration(
      {ABBE_PROGRAM, "calibrate", "otf", "-c", file("abbed.toml"), "--path", file("path.csv")},
      directory_ / "calibrate");
  EXPECT_TRUE(agent_shows("process_kind", "otf"));
  EXPECT_EQ(run({ABBE_PROGRAM, "calibrate", "otf", "-c", file("abbed.toml"), "--cancel"}).code, 0);
  EXPECT_TRUE(agent_shows("process_state", "ABORTED"));
  EXPECT_THAT(observations("message").at(0).text, HasSubstr("cancelled by"));
}

/// An agent ignores what it does not find in its file, and logs what it does not understand.
TEST_F(MtconnectAgent, KnowsEveryDataItemAndReconnectsToARestartedAdapter) {
  configure();
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_adapter());
  ASSERT_NO_FATAL_FAILURE(start_agent());
  ASSERT_TRUE(agent_shows("avail", "AVAILABLE")) << agent_->err();
  const std::string probe = get("/probe");
  for (const char* name : {"avail", "model_state", "model_id", "model_hash", "model_date",
                           "u_volume", "u_type", "simulated", "process_state", "process_id",
                           "process_kind", "message", "devices", "system", "calibration"}) {
    EXPECT_THAT(probe, HasSubstr(fmt::format("name=\"{}\"", name)));
    EXPECT_FALSE(observations(name).empty()) << name;
  }

  // The port of the adapter must stay the same: 0 in the configuration chooses another one.
  const std::string port = std::to_string(listening_port());
  adapter_->signal(SIGKILL);
  EXPECT_TRUE(agent_shows("avail", "UNAVAILABLE"));
  const auto again = start(
      {ABBE_MTCONNECT_PROGRAM, "--socket", file("run/control.sock"), "--port", port}, "again");
  EXPECT_TRUE(agent_shows("avail", "AVAILABLE")) << agent_->err() << again->err();
}

/// ABBE_MTCONNECT_SCHEMAS: the folder "schemas" of cppagent.
TEST(MtconnectSchema, AcceptsTheExampleFile) {
  const char* const schemas = std::getenv("ABBE_MTCONNECT_SCHEMAS");
  if (schemas == nullptr)
    GTEST_SKIP() << "ABBE_MTCONNECT_SCHEMAS does not name the schemas of an agent "
                    "(tests/integration/mtconnect/README.md)";
  const std::string command =
      fmt::format("xmllint --nonet --noout --schema '{}/MTConnectDevices_2.2_1.0.xsd' '{}'",
                  schemas, ABBE_DEVICES_XML);
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
}

}  // namespace
}  // namespace abbe::test
