#include "abbe/service/live_tables_watch.hpp"

#include <exception>
#include <utility>

#include "abbe/methods/otf/live_tables.hpp"
#include "abbe/service/background_tasks.hpp"
#include "outcome.hpp"

namespace abbe::daemon {

/// Call operator() once, on an ordinary thread.
struct LiveTablesWatch::Task {
  std::shared_ptr<const Config> config;
  std::unique_ptr<OtfLiveTables> state;  ///< null: the first task of a session
  RunNews news;

  [[nodiscard]] Solved operator()() {
    if (!state) {
      auto made = OtfLiveTables::of(*config);
      if (!made) return {};  // the identification reports this error
      state = std::make_unique<OtfLiveTables>(std::move(*made));
    }
    state->take(std::move(news));
    auto tables = state->tables();
    return {.state = std::move(state),
            .tables = tables ? std::make_shared<const LiveTables>(std::move(*tables)) : nullptr};
  }
};

LiveTablesWatch::LiveTablesWatch(std::shared_ptr<const Config> config)
    : config_(std::move(config)) {}

LiveTablesWatch::~LiveTablesWatch() = default;

void LiveTablesWatch::cycle(CalibrationSession& session, protocol::HostTime now) {
  if (session.status().id != session_) forget();
  session_ = session.status().id;
  if (task_.valid()) {
    if (ready(task_)) take_result();
    return;
  }

  if (failed_ || now < next_at_) return;
  auto news = session.take_news();
  if (!news) {
    if (state_) destroy_in_background(std::exchange(state_, nullptr));
    return;
  }
  next_at_ = now + kPeriod;
  task_session_ = session_;
  task_ = run_abandonable(
      Task{.config = config_, .state = std::move(state_), .news = std::move(*news)});
}

void LiveTablesWatch::take_result() {
  Solved result;
  try {
    result = task_.get();
  } catch (const std::exception&) {  // the accumulation for the tables is lost, but not the run
  }

  if (task_session_ != session_) {
    if (result.state) destroy_in_background(std::move(result.state));
    return;
  }
  failed_ = result.state == nullptr;
  state_ = std::move(result.state);
  if (result.tables) latest_ = std::move(result.tables);
}

void LiveTablesWatch::forget() {
  latest_ = nullptr;
  failed_ = false;
  next_at_ = {};
  if (state_) destroy_in_background(std::exchange(state_, nullptr));
}

}  // namespace abbe::daemon
