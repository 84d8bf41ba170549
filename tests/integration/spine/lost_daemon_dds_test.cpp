/// The real abbed hangs, continues and is killed while a subscriber runs: the subscriber must stop
/// compensating without it.

#include <gmock/gmock.h>
#include <signal.h>

#include <sstream>

#include "abbe/config/config.hpp"
#include "abbe/model/model_store.hpp"
#include "spine.hpp"
#include "synthetic_model.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;

struct LostDaemon : Spine {
  /// A model of this configuration, active before abbed starts.
  void activate_a_model() {
    const auto config = daemon::load_config(file("abbed.toml"));
    ASSERT_TRUE(config) << config.error().text;
    auto document = daemon::test::synthetic_document(1);
    document.machine_hash = daemon::machine_hash(*config);
    auto store = daemon::ModelStore::open(config->daemon.models_dir());
    ASSERT_TRUE(store);
    const daemon::StoreActor actor{"tester", "test", {}};
    const auto id = store->add(document, true, {}, actor);
    ASSERT_TRUE(id && store->activate(*id, actor));
  }

  /// What the subscriber heard last of the model's state: {"state": "ACTIVE", "reason": ...}.
  [[nodiscard]] json last_state() const {
    json last = json::object();
    std::istringstream lines{watch_->out()};
    for (std::string line; std::getline(lines, line);) {
      if (line.find("\"abbe/v1/ModelState\"") == std::string::npos) continue;
      if (auto said = json::parse(line, nullptr, false); said.is_object()) last = std::move(said);
    }
    return last;
  }
  [[nodiscard]] bool hears(const std::string& state) const {
    return eventually([&] { return last_state().value("state", "") == state; });
  }

  std::unique_ptr<Program> watch_;
};

TEST_F(LostDaemon, IsReportedToItsSubscribersWhetherItHangsOrEnds) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  write_configuration("child");
  ASSERT_NO_FATAL_FAILURE(activate_a_model());
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  watch_ = start({ABBE_WATCH_PROGRAM, "--domain", domain_.text(), "--profile",
                  ABBE_LOOPBACK_PROFILE, "--json", "--timeout-s", "100"},
                 "watch");
  ASSERT_TRUE(hears("ACTIVE")) << last_state().dump();

  abbed_->signal(SIGSTOP);
  EXPECT_TRUE(hears("INVALID")) << last_state().dump();
  EXPECT_THAT(last_state().value("reason", ""), testing::HasSubstr("SOURCE_LOST"));
  abbed_->signal(SIGCONT);
  EXPECT_TRUE(hears("ACTIVE")) << last_state().dump();

  abbed_->signal(SIGKILL);
  EXPECT_TRUE(hears("INVALID")) << last_state().dump();
}

}  // namespace
}  // namespace abbe::test
