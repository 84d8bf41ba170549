/// The page in Chromium, from the wire of the simulated devices to what a person sees and clicks.
/// The programs in tests/web/browser are the person; they end with an error if the page does not
/// show what it must, or reports an error on its console.

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/file_descriptor.hpp"
#include "abbe/config/config.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/web/web_users.hpp"
#include "bar_run.hpp"
#include "synthetic_model.hpp"
#include "touching_run.hpp"

namespace abbe::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kPassword = "a long password";
/// From the request to the first positions; empty: not checked.
constexpr std::string_view kLongestFirstView_ms{ABBE_LONGEST_FIRST_VIEW_MS};

/// abbe-web and a browser beside the programs of `Run`.
template <class Run>
struct Page : Run {
  using Run::Run;

  /// After abbed.toml was written.
  void add_page() {
    std::string users;
    for (const auto role : {web::WebRole::Calibrate, web::WebRole::Administer})
      users += web::web_user_line(std::string{web::name(role)}, role, kPassword).value() + "\n";
    this->write("users", users);
    ::chmod(this->file("users").c_str(), 0640);
    this->write("abbed.toml", text_of(this->file("abbed.toml")) +
                                  "[web]\nport = 0\nlive_hz = 100\nusers = \"users\"\n");
  }

  /// In a file that has a speed: `times` real time.
  void set_speed(const std::string& name, int times) {
    this->write(name, replaced(text_of(this->file(name)), "\nspeed = [0-9]+",
                               fmt::format("\nspeed = {}", times)));
  }

  /// Starts abbe-web; after abbed, which reads the same file.
  void open_server() {
    web_ = this->start({ABBE_WEB_PROGRAM, "--config", this->file("abbed.toml")}, "web");
    ASSERT_TRUE(eventually([this] { return !url().empty() || !web_->running(); }));
    ASSERT_TRUE(web_->running()) << web_->err();
  }

  /// From the log of abbe-web; empty before it listens.
  [[nodiscard]] std::string url() const {
    const std::string log = web_->err();
    const auto begin = log.find("http://");
    const auto end = log.find('\n', begin);
    return begin == std::string::npos || end == std::string::npos ? ""
                                                                  : log.substr(begin, end - begin);
  }

  /// Starts a program of tests/web/browser with the page of abbe-web.
  void browse(const std::string& program, const std::vector<std::string>& more = {}) {
    browse_at(url(), program, more);
  }
  void browse_at(const std::string& address, const std::string& program,
                 const std::vector<std::string>& more) {
    const char* node = ::getenv("ABBE_NODE");
    const char* screenshots = ::getenv("ABBE_SCREENSHOTS");
    std::vector<std::string> command{node == nullptr ? "/usr/bin/node" : node,
                                     std::string{ABBE_BROWSER_TESTS} + "/" + program, address,
                                     screenshots == nullptr ? this->file("") : screenshots};
    command.insert(command.end(), more.begin(), more.end());
    browser_ = this->start(std::move(command), program);
  }
  /// True when the program of the browser has printed `word`.
  [[nodiscard]] bool browser_prints(const std::string& word) {
    const bool printed = eventually(
        [&] { return browser_->out().find(word) != std::string::npos || !browser_->running(); },
        kPatienceForARun);
    return printed && browser_->out().find(word) != std::string::npos;
  }
  void expect_browser_ends_well() {
    EXPECT_EQ(browser_->wait_for_end(2 * kPatienceForARun), 0)
        << browser_->out() << browser_->err() << web_->err();
    if (this->HasFailure()) return;
    fmt::print("{}", browser_->out());
  }

  /// The report of the active model on A4, as abbe and the browser print it.
  void expect_report_prints(const std::string& name) {
    const std::string html = this->file(name + ".html"), pdf = this->file(name + ".pdf");
    const auto made = this->run({ABBE_PROGRAM, "report", "active", "-c", this->file("abbed.toml"),
                                 "-o", html, "--pdf", pdf});
    ASSERT_EQ(made.code, 0) << made.err;
    browse_at("file://" + html, "report.mjs", {pdf});
    expect_browser_ends_well();
  }

  /// A connection that asks for the events and never reads them.
  [[nodiscard]] daemon::FileDescriptor deaf_page() const {
    daemon::FileDescriptor fd{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
    const int smallest = 1;
    (void)::setsockopt(fd.get(), SOL_SOCKET, SO_RCVBUF, &smallest, sizeof smallest);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(std::stoi(url().substr(url().rfind(':') + 1))));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const auto* const address = reinterpret_cast<const sockaddr*>(&to);  // NOLINT
    EXPECT_EQ(::connect(fd.get(), address, sizeof to), 0);
    const std::string request = "GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n";
    EXPECT_EQ(::send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
    return fd;
  }

  std::unique_ptr<Program> web_, browser_;
};

struct PageOnTheFly : Page<Spine> {
  PageOnTheFly() : Page<Spine>("BC") {}

  /// Half as fast as other tests: Chromium without a graphics card draws few pictures in a second.
  static constexpr int kSpeed = ABBE_SPINE_SPEED / 2;
  /// Accepted models of these seeds; the first one is active. Without `machine_hash` they are of
  /// another machine configuration.
  void add_models(const std::vector<unsigned>& seeds, const std::string& machine_hash = {}) const {
    auto store = daemon::ModelStore::open(file("data/models"));
    ASSERT_TRUE(store) << store.error().text;
    const daemon::StoreActor actor{.who = "test", .why = "", .when = {}};
    for (const unsigned seed : seeds) {
      auto document = daemon::test::synthetic_document(seed);
      if (!machine_hash.empty()) document.machine_hash = machine_hash;
      const auto added = store->add(document, true, {}, actor);
      ASSERT_TRUE(added) << added.error().text;
      if (seed == seeds.front()) {
        ASSERT_TRUE(store->activate(*added, actor));
      }
    }
  }
  /// 45 models, one a day; every fifth is refused. The newest accepted one is active.
  void add_many_models() const {
    auto store = daemon::ModelStore::open(file("data/models"));
    ASSERT_TRUE(store) << store.error().text;
    constexpr unsigned kModels = 45;
    const protocol::UtcTime first{std::chrono::sys_days{std::chrono::year{2024} / 1 / 1}};
    auto document = daemon::test::synthetic_document(1);
    for (unsigned i = 1; i <= kModels; ++i) {
      const daemon::StoreActor actor{
          .who = "test", .why = "", .when = first + i * std::chrono::days{1}};
      document.created = actor.when;
      document.machine_hash = fmt::format("{}", i);  // so that each has an id of its own
      document.method = i % 3 == 0 ? "evemu" : "otf";
      const bool accepted = i % 5 != 0;
      std::vector<std::string> reasons;
      if (!accepted) reasons.push_back(fmt::format("held-out rms {} um", i));
      document.verdict = daemon::ModelVerdict{.accepted = accepted, .reasons = reasons};
      const auto added = store->add(document, accepted, reasons, actor);
      ASSERT_TRUE(added) << added.error().text;
      if (i == kModels - 1) {
        ASSERT_TRUE(store->activate(*added, actor));
      }
    }
  }
  /// As after a run that shows that the machine has changed by `what`.
  void find_drift(const std::string& what) const {
    auto store = daemon::ModelStore::open(file("data/models"));
    ASSERT_TRUE(store) << store.error().text;
    const auto active = store->active_id();
    ASSERT_TRUE(active && *active);
    ASSERT_TRUE(store->add_drift(**active, {.who = "test", .why = what, .when = {}}));
  }
  void start_everything(int speed = kSpeed) {
    write_path("path.csv", path());
    set_speed("sim.toml", speed);
    ASSERT_NO_FATAL_FAILURE(start_simulator());
    hold_simulator();
    write_configuration();
    set_speed("abbed.toml", speed);
    add_page();
    ASSERT_NO_FATAL_FAILURE(start_abbed());
    ASSERT_NO_FATAL_FAILURE(open_server());
  }
};

TEST_F(PageOnTheFly, IsCalibratedByClickingAndEveryViewIsRight) {
  ASSERT_NO_FATAL_FAILURE(start_everything());
  browse("otf.mjs", {file("path.csv"), kPassword});
  ASSERT_TRUE(browser_prints("BEGUN")) << browser_->out() << browser_->err();
  simulator_->signal(SIGCONT);
  ASSERT_NO_FATAL_FAILURE(expect_browser_ends_well());
  EXPECT_EQ(status()["model"]["state"], "ACTIVE");
  ASSERT_NO_FATAL_FAILURE(expect_report_prints("report-otf"));

  std::vector<std::string> options{kPassword};
  if (!kLongestFirstView_ms.empty()) options.emplace_back(kLongestFirstView_ms);
  browse("views.mjs", options);
  expect_browser_ends_well();

  browse("identify.mjs", {kPassword});
  ASSERT_NO_FATAL_FAILURE(expect_browser_ends_well());

  // The recording is finished when abbed ends.
  EXPECT_EQ(abbed_->stop(), 0);
  browse("replay.mjs", {kPassword});
  expect_browser_ends_well();
}

TEST_F(PageOnTheFly, ShowsAtOnceThatAbbedOrItsServerIsLost) {
  ASSERT_NO_FATAL_FAILURE(start_everything());
  browse("lost.mjs");
  ASSERT_TRUE(browser_prints("OPEN")) << browser_->out() << browser_->err();
  EXPECT_EQ(abbed_->stop(), 0);
  ASSERT_TRUE(browser_prints("ABBED LOST")) << browser_->out() << browser_->err();
  EXPECT_EQ(web_->stop(), 0);
  ASSERT_TRUE(browser_prints("SERVER LOST")) << browser_->out() << browser_->err();
  expect_browser_ends_well();
}

TEST_F(PageOnTheFly, APageThatReadsNoEventsIsClosedByName) {
  ASSERT_NO_FATAL_FAILURE(start_everything());
  const daemon::FileDescriptor deaf = deaf_page();
  EXPECT_TRUE(eventually([this] {
    return web_->err().find("the page does not read its events: closed") != std::string::npos;
  })) << web_->err();
}

TEST_F(PageOnTheFly, ComparesTwoModelsAndAsksBeforeAChange) {
  ASSERT_NO_FATAL_FAILURE(add_models({3, 4}));
  ASSERT_NO_FATAL_FAILURE(start_everything());
  browse("compare.mjs", {kPassword});
  expect_browser_ends_well();
  browse("keyboard.mjs", {kPassword});
  expect_browser_ends_well();
}

TEST_F(PageOnTheFly, ListsManyModelsInPagesThatAreSearched) {
  ASSERT_NO_FATAL_FAILURE(add_many_models());
  ASSERT_NO_FATAL_FAILURE(start_everything());
  browse("history.mjs");
  expect_browser_ends_well();
}

TEST_F(PageOnTheFly, CurvesShowTheLastMinutesWithTheirGaps) {
  ASSERT_NO_FATAL_FAILURE(start_everything(1));  // its steps are real seconds
  simulator_->signal(SIGCONT);
  browse("curves.mjs");
  ASSERT_TRUE(browser_prints("SHOWN")) << browser_->out() << browser_->err();
  EXPECT_EQ(abbed_->stop(), 0);
  ASSERT_TRUE(browser_prints("GAP")) << browser_->out() << browser_->err();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  expect_browser_ends_well();
}

TEST_F(PageOnTheFly, OpenViewsShowDrift) {
  ASSERT_NO_FATAL_FAILURE(start_everything());
  const auto config = daemon::load_config(file("abbed.toml"));
  ASSERT_TRUE(config) << config.error().text;
  ASSERT_NO_FATAL_FAILURE(add_models({3}, daemon::machine_hash(*config)));
  browse("drift.mjs");
  ASSERT_TRUE(browser_prints("GREEN")) << browser_->out() << browser_->err();
  find_drift("EXX by 4 um");
  ASSERT_TRUE(browser_prints("FOCUSED")) << browser_->out() << browser_->err();
  find_drift("EYY by 3 um");
  expect_browser_ends_well();
}

struct PageBallArray : Page<TouchingRun> {
  /// abbe-web asks for the status every 0.5 s: each ball and block must be the next for longer,
  /// also on a computer that draws slowly.
  static constexpr int kSpeed = std::min(ABBE_SPINE_SPEED, 5);
};

TEST_F(PageBallArray, IsCalibratedByClicking) {
  set_speed("sim.toml", kSpeed);
  ASSERT_NO_FATAL_FAILURE(start_touching_simulator());
  write_touching_configuration();
  set_speed("abbed.toml", kSpeed);
  add_page();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_NO_FATAL_FAILURE(open_server());
  browse("array.mjs", {file("calibrator.toml"), kPassword});
  ASSERT_TRUE(browser_prints("BEGUN")) << browser_->out() << browser_->err();
  let_machine_go();
  expect_browser_ends_well();
  EXPECT_EQ(status()["model"]["state"], "ACTIVE");
  expect_report_prints("report-array");
}

struct PageBar : Page<BarRun> {};

TEST_F(PageBar, ItsPlacesAreDrawnAndASessionIsCancelled) {
  ASSERT_NO_FATAL_FAILURE(start_bar_simulator());
  write_bar_configuration();
  add_page();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_NO_FATAL_FAILURE(open_server());
  browse("bar.mjs", {file("bar/bar.toml"), file("bar/plan.toml"), kPassword});
  expect_browser_ends_well();
  EXPECT_THAT(status()["session"]["reason"].get<std::string>(),
              AllOf(HasSubstr("cancelled by"), HasSubstr("(as calibrate)")));
}

}  // namespace
}  // namespace abbe::test
