// SPDX-License-Identifier: GPL-2.0-or-later
#include "control_link.hpp"

#include <signal.h>
#include <sys/shm.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <thread>
#include <utility>

namespace abbe::linuxcnc {
namespace {

/// If the process of a feeder exists but does not write for this time, the feeder is replaced: it
/// hangs, or another program has its process id.
constexpr std::chrono::milliseconds kLongestPause{300};
/// Without a servo cycle for this time, LinuxCNC counts as ended if none of its processes is
/// attached to the memory any more. A LinuxCNC that is halted, for example in a debugger, does not
/// count as ended.
constexpr std::chrono::seconds kLongestStandstill{5};

std::uint32_t wanted_number(const abbe_hand_over& memory) {
  return __atomic_load_n(&memory.wanted_sequence.end, __ATOMIC_ACQUIRE);
}

bool writes(const abbe_hand_over& memory, std::int32_t feeder) {
  if (feeder == 0 || (::kill(feeder, 0) != 0 && errno == ESRCH)) return false;
  const auto before = wanted_number(memory);
  std::this_thread::sleep_for(kLongestPause);
  return wanted_number(memory) != before;
}

/// True: this process has become the feeder. False: another process is the feeder; its id is in
/// `other`.
bool become_feeder(abbe_hand_over& memory, std::int32_t& other) {
  other = __atomic_load_n(&memory.feeder, __ATOMIC_ACQUIRE);
  if (other != ::getpid() && writes(memory, other)) return false;
  // If two feeders start at the same time, one of them succeeds.
  return __atomic_compare_exchange_n(&memory.feeder, &other, ::getpid(), false, __ATOMIC_ACQ_REL,
                                     __ATOMIC_ACQUIRE);
}

/// True if another process is attached to the memory; false if its state cannot be read.
bool is_attached_elsewhere(int segment) {
  shmid_ds state{};
  return ::shmctl(segment, IPC_STAT, &state) == 0 && state.shm_nattch > 1;
}

}  // namespace

std::optional<ControlLink> ControlLink::attach(int key, std::string& error) {
  const int segment = ::shmget(key, ABBE_HAND_OVER_SIZE, 0600);
  void* const mapped = segment < 0 ? nullptr : ::shmat(segment, nullptr, 0);
  if (segment < 0 || mapped == reinterpret_cast<void*>(-1)) {
    error = std::string("LinuxCNC does not run with abbe_correction (its shared memory: ") +
            std::strerror(errno) + "); start it first, as the same user";
    return std::nullopt;
  }

  ControlLink link(static_cast<abbe_hand_over*>(mapped), segment);
  if (__atomic_load_n(&link.memory_->version, __ATOMIC_ACQUIRE) != ABBE_HAND_OVER_VERSION ||
      link.closed()) {
    error = "LinuxCNC does not run with abbe_correction of this version";
    return std::nullopt;
  }
  std::int32_t other = 0;
  if (!become_feeder(*link.memory_, other)) {
    error = "another abbe-linuxcnc-feeder runs (process " + std::to_string(other) + "); end it";
    return std::nullopt;
  }
  // the values of the previous feeder do not apply to this one
  abbe_wanted nothing{};
  std::strcpy(nothing.reason, "the feeder has started");
  link.write(nothing);
  return link;
}

ControlLink::ControlLink(ControlLink&& other) noexcept
    : memory_(std::exchange(other.memory_, nullptr)),
      segment_(other.segment_),
      control_(other.control_),
      seen_cycle_(other.seen_cycle_),
      cycled_at_(other.cycled_at_) {}

ControlLink::~ControlLink() {
  if (memory_ == nullptr) return;
  std::int32_t own = ::getpid();
  __atomic_compare_exchange_n(&memory_->feeder, &own, 0, false, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
  ::shmdt(memory_);
}

const abbe_control& ControlLink::read() {
  // The realtime thread seldom preempts the feeder within a copy; a second attempt then succeeds.
  constexpr int kAttempts = 2;
  abbe_control control;
  std::uint32_t number = 0;
  for (int i = 0; i < kAttempts; ++i) {
    if (!abbe_read(&memory_->control_sequence, &control, &memory_->control, sizeof control,
                   &number))
      continue;
    control_ = control;
    break;
  }
  return control_;
}

void ControlLink::write(const abbe_wanted& wanted) {
  abbe_write(&memory_->wanted_sequence, &memory_->wanted, &wanted, sizeof wanted);
}

bool ControlLink::closed() const {
  return __atomic_load_n(&memory_->closed, __ATOMIC_ACQUIRE) != 0;
}

std::string ControlLink::ended(Clock::time_point now) {
  if (closed()) return "LinuxCNC has ended";
  if (__atomic_load_n(&memory_->feeder, __ATOMIC_ACQUIRE) != ::getpid())
    return "another abbe-linuxcnc-feeder has replaced this one, or LinuxCNC was started again";
  // before the first cycle, LinuxCNC is still loading its configuration
  if (control_.cycle != seen_cycle_ || control_.cycle == 0) {
    seen_cycle_ = control_.cycle;
    cycled_at_ = now;
  }
  if (now - cycled_at_ <= kLongestStandstill || is_attached_elsewhere(segment_)) return {};
  return "LinuxCNC no longer cycles";
}

std::optional<abbe_wanted> ControlLink::sent() const {
  abbe_wanted wanted;
  std::uint32_t number = 0;
  if (!abbe_read(&memory_->wanted_sequence, &wanted, &memory_->wanted, sizeof wanted, &number))
    return std::nullopt;
  return wanted;
}

}  // namespace abbe::linuxcnc
