#include "live_truth.hpp"

#include <fmt/format.h>
#include <net/if.h>
#include <sched.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <thread>
#include <utility>

namespace abbe::test {
namespace {

constexpr double kLongestHold_s = 1.5;
constexpr double kReturn_s = 10.0;
/// Until a started subscriber applies: a lost handshake is repeated after the lease of 40 s.
constexpr double kConnect_s = 90.0;
constexpr HostNs kVectorClock_ns = 1'000'000'000'000;  // what the feeder's vectors are modulo of

HostNs now_ns() {
  return Clock::now().time_since_epoch().count();
}

double seconds(HostNs ns) {
  return 1e-9 * static_cast<double>(ns);
}

void wait(double duration_s) {
  std::this_thread::sleep_for(std::chrono::duration<double>(duration_s));
}

/// The process of abbe-dds, as the feeder announced it last; 0 while there is none.
pid_t announced_child(Process& feeder) {
  pid_t pid = 0;
  for (const Line& line : feeder.lines()) std::sscanf(line.text.c_str(), "child %d", &pid);
  return pid;
}

}  // namespace

// -------------------------------------------------------------------------------------------------
// content of the lines that the examples print

void SubscriberRecord::take(const std::string& line) {
  long long stamp = 0;
  std::array<char, 65> name{};
  int begin = 0;
  if (std::sscanf(line.c_str(), "%lld %64[^:]: %n", &stamp, name.data(), &begin) != 2 || begin == 0)
    return;
  const char* const text = line.c_str() + begin;
  int state = 0;
  const std::lock_guard lock(mutex_);

  if (std::strncmp(text, "apply", 5) == 0) {
    note_apply(name.data(), stamp, text);
  } else if (std::strncmp(text, "not alive", 9) == 0 ||
             (std::sscanf(text, "state %d", &state) == 1 && state != 1)) {
    machines_[name.data()].dead.push_back(stamp);
  }
}

void SubscriberRecord::note_apply(const std::string& machine, HostNs now, const char* text) {
  double made_us = 0.0, claimed_ms = 0.0;
  if (std::sscanf(text, "apply V = %lf %*f %*f um, %lf ms old", &made_us, &claimed_ms) != 2) return;
  machines_[machine].last_apply = now;
  ++applied_;
  const HostNs made_ns = std::llround(made_us * 1e3);
  const HostNs age_ns = ((now - made_ns) % kVectorClock_ns + kVectorClock_ns) % kVectorClock_ns;
  const double understatement_ms = 1e-6 * static_cast<double>(age_ns) - claimed_ms;
  worst_ms_ = std::max(worst_ms_, understatement_ms);
  understated_ += understatement_ms > tolerance_ms_;
}

void SubscriberRecord::forget() {
  const std::lock_guard lock(mutex_);
  for (auto& [name, machine] : machines_) machine.dead.clear();
}

HostNs SubscriberRecord::dead_since(const std::string& machine, HostNs from) const {
  const std::lock_guard lock(mutex_);
  const auto found = machines_.find(machine);
  if (found == machines_.end()) return 0;
  const auto& dead = found->second.dead;
  const auto first = std::ranges::find_if(dead, [&](HostNs at) { return at >= from; });
  return first == dead.end() ? 0 : *first;
}

HostNs SubscriberRecord::last_apply(const std::string& machine) const {
  const std::lock_guard lock(mutex_);
  const auto found = machines_.find(machine);
  return found == machines_.end() ? 0 : found->second.last_apply;
}

double SubscriberRecord::worst_understatement_ms() const {
  const std::lock_guard lock(mutex_);
  return worst_ms_;
}
std::uint64_t SubscriberRecord::applied() const {
  const std::lock_guard lock(mutex_);
  return applied_;
}
std::uint64_t SubscriberRecord::understated() const {
  const std::lock_guard lock(mutex_);
  return understated_;
}

// -------------------------------------------------------------------------------------------------
// the rounds

struct LiveTruth::Subscriber {
  Subscriber(std::string its_name, std::vector<std::string> its_command, double tolerance_ms)
      : name(std::move(its_name)), command(std::move(its_command)), record(tolerance_ms) {}

  std::string name;
  std::vector<std::string> command;
  SubscriberRecord record;
  std::unique_ptr<Process> process{};

  void start() {
    process.reset();
    process =
        std::make_unique<Process>(command, [this](const Line& line) { record.take(line.text); });
  }
};

struct LiveTruth::Machine {
  std::string name;
  std::unique_ptr<Process> feeder{};
};

LiveTruth::LiveTruth(Parts parts) : parts_(std::move(parts)) {
  for (const char* name : {"mill-a", "mill-b"}) {
    machines_.push_back(std::make_unique<Machine>(Machine{name, nullptr}));
    machines_.back()->feeder = parts_.start_machine(name);
  }
  const auto add = [&](const char* name, const std::vector<std::string>& command) {
    subscribers_.push_back(std::make_unique<Subscriber>(name, command, parts_.tolerance_ms));
    subscribers_.back()->start();
  };
  add("Fast DDS", parts_.fast_subscriber);
  add("Cyclone DDS", parts_.cyclone_subscriber);
}

LiveTruth::~LiveTruth() = default;

bool LiveTruth::begin() {
  return all_apply(now_ns(), kConnect_s);
}

bool LiveTruth::all_apply(HostNs since, double patience_s) {
  const auto applies = [&] {
    return std::ranges::all_of(subscribers_, [&](const auto& s) {
      return std::ranges::all_of(
          machines_, [&](const auto& m) { return s->record.last_apply(m->name) > since; });
    });
  };
  const HostNs deadline = now_ns() + static_cast<HostNs>(patience_s * 1e9);
  while (!applies() && now_ns() < deadline) wait(0.005);
  return applies();
}

void LiveTruth::expect_dead(const std::vector<Machine*>& dead, HostNs since,
                            const std::string& what) {
  for (const auto& s : subscribers_) {
    for (const Machine* m : dead) {
      const HostNs noticed = s->record.dead_since(m->name, since);
      const HostNs last = s->record.last_apply(m->name);
      const double hold_s = noticed == 0 ? 99.0 : seconds(std::max(noticed, last) - since);
      figures_.longest_hold_s = std::max(figures_.longest_hold_s, hold_s);
      if (hold_s <= kLongestHold_s) continue;
      ++figures_.held_too_long;
      figures_.failures.push_back(
          fmt::format("{}: {} held {} for {:.2f} s", what, s->name, m->name, hold_s));
    }
  }
}

void LiveTruth::expect_all_apply(HostNs since, const std::string& what) {
  const HostNs begin = now_ns();
  if (!all_apply(since, kReturn_s)) {
    for (const auto& s : subscribers_) {
      const bool orphan = std::ranges::any_of(
          machines_, [&](const auto& m) { return s->record.last_apply(m->name) <= since; });
      if (!orphan) continue;
      ++figures_.orphaned;
      figures_.failures.push_back(fmt::format("{}: {} is orphaned", what, s->name));
      s->start();
    }
    static_cast<void>(all_apply(now_ns(), kConnect_s));
    return;
  }

  figures_.longest_return_s = std::max(figures_.longest_return_s, seconds(now_ns() - begin));
}

/// Returns when the disturbance is over; no subscriber may apply vectors of `dead` during it.
void LiveTruth::strike(Blow blow, double duration_s, const std::vector<Machine*>& dead) {
  Machine& a = *machines_.front();
  const pid_t child = announced_child(*a.feeder);
  switch (blow) {
    case Blow::KillMachine:
      ::kill(child, SIGSTOP);  // it would publish INVALID when its abbed has ended
      a.feeder->signal(SIGKILL);
      ::kill(child, SIGKILL);
      wait(duration_s);
      return;
    case Blow::StopAbbed:
    case Blow::StopAbbeDds: {
      const pid_t stopped = blow == Blow::StopAbbed ? a.feeder->pid() : child;
      ::kill(stopped, SIGSTOP);
      wait(duration_s);
      return;
    }
    case Blow::StopSubscriber:
      for (const auto& s : subscribers_) s->process->signal(SIGSTOP);
      wait(duration_s);
      for (const auto& s : subscribers_) s->process->signal(SIGCONT);
      return;
    case Blow::Outage:
      switch_loopback(false);
      wait(duration_s);
      return;
  }

  static_cast<void>(dead);
}

void LiveTruth::round(Blow blow, double duration_s) {
  constexpr std::array kNames{"kill", "stop of abbed", "stop of abbe-dds",
                              "stop of the subscribers", "outage"};
  const std::string what = fmt::format("round {}, {} of {:.1f} s", ++figures_.rounds,
                                       kNames[static_cast<std::size_t>(blow)], duration_s);
  Machine& a = *machines_.front();
  std::vector<Machine*> dead;
  if (blow != Blow::StopSubscriber) dead.push_back(&a);
  if (blow == Blow::Outage) dead.push_back(machines_.back().get());

  const HostNs since = now_ns();
  const pid_t child = announced_child(*a.feeder);
  strike(blow, duration_s, dead);
  if (duration_s > kLongestHold_s) expect_dead(dead, since, what);
  if (blow == Blow::KillMachine) a.feeder = parts_.start_machine(a.name);
  if (blow == Blow::StopAbbed) a.feeder->signal(SIGCONT);
  if (blow == Blow::StopAbbeDds) ::kill(child, SIGCONT);
  if (blow == Blow::Outage) switch_loopback(true);
  expect_all_apply(now_ns(), what);
  for (const auto& s : subscribers_) s->record.forget();
}

void LiveTruth::random_round(std::mt19937& random) {
  std::vector<Blow> blows{Blow::KillMachine, Blow::StopAbbed, Blow::StopAbbeDds,
                          Blow::StopSubscriber};
  if (parts_.has_network_of_its_own) blows.push_back(Blow::Outage);
  const Blow blow = blows[static_cast<std::size_t>(figures_.rounds) % blows.size()];
  const double exponent = std::uniform_real_distribution<>(0.0, 1.0)(random);
  wait(std::uniform_real_distribution<>(0.0, 1.0)(random));  // any phase of the states
  // 1 to 30 s, as often below 5.5 s as above; a kill has no length of its own.
  round(blow, blow == Blow::KillMachine ? 1.6 + exponent : std::pow(30.0, exponent));
}

LiveTruthFigures LiveTruth::figures() const {
  LiveTruthFigures all = figures_;
  for (const auto& s : subscribers_) {
    all.applied += s->record.applied();
    all.understated += s->record.understated();
    all.worst_understatement_ms =
        std::max(all.worst_understatement_ms, s->record.worst_understatement_ms());
  }
  return all;
}

// -------------------------------------------------------------------------------------------------
// the programs

SubscriberCommands subscriber_commands(const std::string& domain, const std::filesystem::path& keys,
                                       bool real_time) {
  SubscriberCommands commands{{ABBE_STAMPED_FAST_SUBSCRIBER, domain, ABBE_LOOPBACK_PROFILE},
                              {ABBE_STAMPED_CYCLONE_SUBSCRIBER, domain}};

  if (!keys.empty()) {
    commands.fast.push_back(keys / "subscriber-1");
    commands.cyclone.push_back(keys / "subscriber-2");
  }

  for (auto* command : {&commands.fast, &commands.cyclone})
    if (real_time) command->insert(command->begin(), {"/usr/bin/chrt", "-f", "10"});
  return commands;
}

bool real_time_permitted() {
  const sched_param ordinary{}, first{.sched_priority = 10};
  const bool permitted = ::sched_setscheduler(0, SCHED_FIFO, &first) == 0;
  ::sched_setscheduler(0, SCHED_OTHER, &ordinary);
  return permitted;
}

// -------------------------------------------------------------------------------------------------
// a network of its own

bool enter_own_network() {
  if (::unshare(CLONE_NEWNET) != 0) return false;
  switch_loopback(true);
  return true;
}

void switch_loopback(bool on) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ifreq request{};
  std::strcpy(request.ifr_name, "lo");
  ::ioctl(fd, SIOCGIFFLAGS, &request);
  const int flags = on ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP;
  request.ifr_flags = static_cast<short>(flags);
  if (::ioctl(fd, SIOCSIFFLAGS, &request) != 0) std::perror("loopback");
  ::close(fd);
}

}  // namespace abbe::test
