#include "abbe/daemon/work_aside.hpp"

#include <pthread.h>
#include <sched.h>
#include <unistd.h>

namespace abbe::daemon {

void become_ordinary_thread() noexcept {
  const sched_param none{};
  (void)::pthread_setschedparam(::pthread_self(), SCHED_OTHER, &none);
  cpu_set_t cpus;
  if (::sched_getaffinity(::getpid(), sizeof cpus, &cpus) == 0)  // of the main thread
    (void)::pthread_setaffinity_np(::pthread_self(), sizeof cpus, &cpus);
}

}  // namespace abbe::daemon
