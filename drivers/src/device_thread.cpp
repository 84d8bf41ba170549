#include "abbe/drivers/device_thread.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <exception>
#include <future>
#include <thread>
#include <utility>

#include "abbe/drivers/real_time_memory.hpp"
#include "abbe/drivers/status_board.hpp"

namespace abbe::drivers {
namespace {

/// Pause of the thread after an exception while a machine may be moving.
constexpr std::chrono::milliseconds kStopRetry{10};

using Refusals = std::vector<std::string>;

std::string reason(int error_number) {
  return std::strerror(error_number);
}

void set_priority(int priority, Refusals& refusals) {
  const sched_param param{.sched_priority = priority};
  if (const int e = pthread_setschedparam(pthread_self(), SCHED_FIFO, &param); e != 0) {
    refusals.push_back(
        fmt::format("SCHED_FIFO priority {}: {} (CAP_SYS_NICE is needed)", priority, reason(e)));
  }
}

void set_affinity(int cpu, Refusals& refusals) {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (cpu >= 0 && cpu < CPU_SETSIZE) CPU_SET(static_cast<unsigned>(cpu), &set);
  if (const int e = pthread_setaffinity_np(pthread_self(), sizeof set, &set); e != 0) {
    refusals.push_back(fmt::format("affinity to processor {}: {}", cpu, reason(e)));
  }
}

Refusals prepare_this_thread(const DeviceThreadOptions& o) {
  pthread_setname_np(pthread_self(), o.name.substr(0, 15).c_str());
  touch_stack();  // 64 kB is far more than any measured use by receive()
  Refusals refusals = o.lock_memory ? lock_memory() : Refusals{};
  if (o.cpu) set_affinity(*o.cpu, refusals);
  if (o.priority != 0) set_priority(o.priority, refusals);
  return refusals;
}

std::string text_of(const std::exception_ptr& cause) {
  try {
    std::rethrow_exception(cause);
  } catch (const std::exception& e) {
    return e.what();
  } catch (...) {
    return "an exception not derived from std::exception";
  }
}

}  // namespace

struct DeviceThread::State {
  Device& device;
  DeviceThreadOptions options;
  std::vector<std::string> warnings;
  LatencyHistogram latency;
  std::atomic<bool> stop{false};
  FaultText failure;               ///< the latest exception that ended the loop
  std::atomic<bool> ended{false};  ///< true from an exception until a wait() returns again
  std::atomic<std::uint64_t> failures{0};
  std::thread thread;

  State(Device& d, DeviceThreadOptions o) : device(d), options(std::move(o)) {}

  [[nodiscard]] bool stopping() const noexcept {
    // acquire: pairs with the release in DeviceThread::stop()
    return stop.load(std::memory_order_acquire);
  }

  void loop() {
    while (!stopping()) {
      device.wait(options.wait_at_most);
      if (ended.load(std::memory_order_relaxed)) [[unlikely]]
        ended.store(false, std::memory_order_release);  // pairs with the acquire in failure()
      const auto begin = std::chrono::steady_clock::now();
      device.receive();
      latency.record(std::chrono::steady_clock::now() - begin);
    }
  }

  void fail(const std::exception_ptr& cause) {
    failure.set({}, text_of(cause));
    ended.store(true, std::memory_order_release);  // pairs with the acquire in failure()
    // release: pairs with the acquire in failures(); a reader of the count also sees `ended`
    failures.fetch_add(1, std::memory_order_release);
  }

  /// Stops the motion of the device. True: the motion may continue.
  [[nodiscard]] bool motion_goes_on() noexcept {
    try {
      return device.stop_after_failure();
    } catch (...) {
      fail(std::current_exception());
      return true;
    }
  }

  /// Sleeps in steps of wait_at_most, so that the thread reacts to stop().
  void pause(std::chrono::nanoseconds time) const {
    const auto until = std::chrono::steady_clock::now() + time;
    while (!stopping()) {
      const auto left = until - std::chrono::steady_clock::now();
      if (left <= std::chrono::nanoseconds{0}) return;
      std::this_thread::sleep_for(std::min<std::chrono::nanoseconds>(left, options.wait_at_most));
    }
  }

  /// The thread's top function: catches and stores an exception of the loop, and starts the loop
  /// again.
  void run(std::promise<Refusals> ready) noexcept {
    Refusals refusals = prepare_this_thread(options);
    const bool go = refusals.empty() || options.mode == RealTimeMode::Ignore;
    ready.set_value(std::move(refusals));
    if (!go) return;

    for (auto back_off = options.first_back_off; !stopping();) {
      const auto begun = std::chrono::steady_clock::now();
      try {
        loop();
      } catch (...) {
        fail(std::current_exception());
        if (motion_goes_on()) {
          pause(kStopRetry);
          continue;
        }
        if (std::chrono::steady_clock::now() - begun > options.longest_back_off)
          back_off = options.first_back_off;  // the loop ran long enough
        pause(back_off);
        back_off = std::min(2 * back_off, options.longest_back_off);
      }
    }
  }
};

Result<std::unique_ptr<DeviceThread>> DeviceThread::start(Device& device,
                                                          DeviceThreadOptions options) {
  auto state = std::make_unique<State>(device, std::move(options));
  const auto refused = [&state](const std::string& seen) {
    return tl::unexpected(
        Error{ErrorCode::SystemRefused, fmt::format("thread {}: {}", state->options.name, seen)});
  };

  std::promise<Refusals> ready;
  auto refusals = ready.get_future();
  try {
    state->thread = std::thread(&State::run, state.get(), std::move(ready));
  } catch (const std::system_error& e) {
    return refused(e.what());
  }

  state->warnings = refusals.get();
  if (!state->warnings.empty() && state->options.mode == RealTimeMode::Enforce) {
    state->thread.join();
    return refused(fmt::format("{}", fmt::join(state->warnings, "; ")));
  }

  return std::unique_ptr<DeviceThread>(new DeviceThread(std::move(state)));
}

DeviceThread::DeviceThread(std::unique_ptr<State> state) : state_(std::move(state)) {}
DeviceThread::~DeviceThread() {
  stop();
}

void DeviceThread::stop() {
  // release: pairs with the acquire in State::loop()
  state_->stop.store(true, std::memory_order_release);
  if (state_->thread.joinable()) state_->thread.join();
}

const std::vector<std::string>& DeviceThread::warnings() const noexcept {
  return state_->warnings;
}
const LatencyHistogram& DeviceThread::latency() const noexcept {
  return state_->latency;
}

std::optional<std::string> DeviceThread::failure() const {
  // acquire: pairs with the releases in State::fail() and State::loop()
  if (!state_->ended.load(std::memory_order_acquire)) return std::nullopt;
  return state_->failure.read().text;
}

DeviceStatus DeviceThread::status() const {
  DeviceStatus status = state_->device.status();
  status.faults += failures();
  if (const auto cause = failure()) {
    status.state = "internal error";
    status.connected = false;
    status.last_fault = fmt::format("{}: internal error, the device thread restarts: {}",
                                    state_->options.name, *cause);
  }
  return status;
}

std::uint64_t DeviceThread::failures() const noexcept {
  // pairs with the release in State::fail()
  return state_->failures.load(std::memory_order_acquire);
}

}  // namespace abbe::drivers
