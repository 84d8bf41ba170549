#include "hub_thread.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>

#include <cstdio>
#include <cstring>
#include <exception>
#include <utility>

#include "abbe/drivers/real_time_memory.hpp"

namespace abbe::daemon {
namespace {

/// Sets the priority. If the system refuses it, this is a warning in mode `ignore`.
Result<void> set_priority(std::thread& thread, const DaemonConfig& config) {
  sched_param parameters{};
  parameters.sched_priority = config.hub_priority;
  int error = ::pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameters);
  if (error == 0 && config.hub_cpu) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(*config.hub_cpu, &cpus);
    error = ::pthread_setaffinity_np(thread.native_handle(), sizeof cpus, &cpus);
  }
  if (error == 0) return {};
  return fail(ErrorCode::Io, fmt::format("hub thread: SCHED_FIFO {}: {}", config.hub_priority,
                                         std::strerror(error)));
}

void run_hub(std::future<Hub*>& awaited) noexcept {
  (void)::pthread_setname_np(::pthread_self(), "abbe-hub");
  drivers::prepare_heap_of_this_thread();
  Hub* hub = nullptr;
  try {
    hub = awaited.get();
  } catch (const std::future_error&) {
    return;
  }
  try {
    hub->run();
  } catch (const std::exception& error) {  // Abbed::alive() then returns false
    // without the hub nothing supervises the machine if its operator is gone
    (void)hub->parts().devices.stop_machine();
    fmt::print(stderr, "abbed: the hub ended with an internal error: {}\n", error.what());
  }
}

}  // namespace

Result<void> HubThread::start(const DaemonConfig& config) {
  thread_ = std::thread([awaited = hub_.get_future()]() mutable { run_hub(awaited); });
  return set_priority(thread_, config);
}

void HubThread::end() {
  hub_ = {};
  if (thread_.joinable()) thread_.join();
}

}  // namespace abbe::daemon
