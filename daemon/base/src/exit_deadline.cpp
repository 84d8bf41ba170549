#include "abbe/base/exit_deadline.hpp"

#include <unistd.h>

#include <utility>

namespace abbe::daemon {

ExitDeadline::ExitDeadline(std::chrono::nanoseconds patience, int exit_code, std::string message)
    : thread_([this, patience, exit_code, text = std::move(message)] {
        if (met_.wait_for(patience)) return;
        (void)!::write(STDERR_FILENO, text.data(),
                       text.size());  // stdio may be locked by what hangs
        ::_exit(exit_code);
      }) {}

ExitDeadline::~ExitDeadline() {
  met_.signal();
  thread_.join();
}

}  // namespace abbe::daemon
