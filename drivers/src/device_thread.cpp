#include "abbe/drivers/device_thread.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>

#include <array>
#include <atomic>
#include <cstring>
#include <exception>
#include <future>
#include <mutex>
#include <thread>
#include <utility>

namespace abbe::drivers {
namespace {

using Refusals = std::vector<std::string>;

std::string reason(int error_number) {
  return std::strerror(error_number);
}

/// Locked pages are still gathered into huge ones by khugepaged, an ordinary thread of the least priority: on
/// a busy computer a device thread that touches one meanwhile was seen to wait for 0.5 s.
void lock_memory(Refusals& refusals) {
  if (prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0) != 0)
    refusals.push_back(fmt::format("no huge pages: {}", reason(errno)));
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    refusals.push_back(
        fmt::format("mlockall: {} (CAP_IPC_LOCK or LimitMEMLOCK=infinity is needed)", reason(errno)));
  }
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

/// The loop must not fault a stack page in later. 64 kB is far above what any receive() was seen to use.
[[gnu::noinline]] void touch_stack() {
  std::array<volatile char, 64 * 1024> room;  // NOLINT: touched, not initialised, on purpose
  constexpr std::size_t kPage = 4096;
  for (std::size_t i = 0; i < room.size(); i += kPage) room[i] = 0;
}

Refusals prepare_this_thread(const DeviceThreadOptions& o) {
  Refusals refusals;
  pthread_setname_np(pthread_self(), o.name.substr(0, 15).c_str());
  touch_stack();
  if (o.lock_memory) lock_memory(refusals);
  if (o.cpu) set_affinity(*o.cpu, refusals);
  if (o.priority != 0) set_priority(o.priority, refusals);
  return refusals;
}

std::string in_words(const std::exception_ptr& cause) {
  try {
    std::rethrow_exception(cause);
  } catch (const std::exception& e) {
    return e.what();
  } catch (...) {
    return "an exception that is no std::exception";
  }
}

}  // namespace

struct DeviceThread::State {
  Device& device;
  DeviceThreadOptions options;
  std::vector<std::string> warnings;
  LatencyHistogram latency;
  std::atomic<bool> stop{false};
  mutable std::mutex failure_mutex;  ///< taken when the loop has ended, never in it
  std::optional<std::string> failure;
  std::thread thread;

  State(Device& d, DeviceThreadOptions o) : device(d), options(std::move(o)) {}

  void loop() {
    while (
        !stop.load(std::memory_order_acquire)) {  // acquire: pairs with the release in DeviceThread::stop()
      device.wait(options.wait_at_most);
      const auto begin = std::chrono::steady_clock::now();
      device.receive();
      latency.record(std::chrono::steady_clock::now() - begin);
    }
  }

  /// The thread's top function: what the loop throws ends here and is kept.
  void run(std::promise<Refusals> ready) noexcept {
    Refusals refusals = prepare_this_thread(options);
    const bool go = refusals.empty() || options.mode == RealTimeMode::Ignore;
    ready.set_value(std::move(refusals));
    if (!go) return;
    try {
      loop();
    } catch (...) {
      const std::lock_guard lock(failure_mutex);
      failure = in_words(std::current_exception());
    }
  }
};

Result<std::unique_ptr<DeviceThread>> DeviceThread::start(Device& device, DeviceThreadOptions options) {
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
  state_->stop.store(true, std::memory_order_release);  // release: pairs with the acquire in State::loop()
  if (state_->thread.joinable()) state_->thread.join();
}

const std::vector<std::string>& DeviceThread::warnings() const noexcept {
  return state_->warnings;
}
const LatencyHistogram& DeviceThread::latency() const noexcept {
  return state_->latency;
}

std::optional<std::string> DeviceThread::failure() const {
  const std::lock_guard lock(state_->failure_mutex);
  return state_->failure;
}

}  // namespace abbe::drivers
