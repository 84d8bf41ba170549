#include "interruption.hpp"

#include <signal.h>

#include <csignal>

namespace abbe::daemon {
namespace {

volatile std::sig_atomic_t signalled = 0;

}  // namespace

void mark_interruptions(std::initializer_list<int> signals) {
  struct sigaction mark {};
  mark.sa_handler = [](int) { signalled = 1; };
  for (const int signal : signals) ::sigaction(signal, &mark, nullptr);
}

bool interrupted() {
  return signalled != 0;
}

}  // namespace abbe::daemon
