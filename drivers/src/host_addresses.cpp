#include "abbe/drivers/host_addresses.hpp"

#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sched.h>

#include <array>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

namespace abbe::drivers {
namespace {

Result<std::vector<HostAddress>> addresses_of(const std::string& host, std::uint16_t port,
                                              int flags) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_NUMERICSERV | flags;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (error != 0)
    return tl::unexpected{
        Error{ErrorCode::Unreachable, fmt::format("no address: {}", ::gai_strerror(error))}};
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner{found, &::freeaddrinfo};

  std::vector<HostAddress> addresses;
  for (const addrinfo* a = found; a != nullptr; a = a->ai_next) {
    HostAddress& address = addresses.emplace_back();
    std::memcpy(&address.at, a->ai_addr, a->ai_addrlen);
    address.length = a->ai_addrlen;
  }
  return addresses;
}

}  // namespace

std::string text_of(const HostAddress& address) {
  std::array<char, NI_MAXHOST> text{};
  const auto* generic =
      reinterpret_cast<const sockaddr*>(&address.at);  // NOLINT: sockets interface
  (void)::getnameinfo(generic, address.length, text.data(), text.size(), nullptr, 0,
                      NI_NUMERICHOST);
  return text.data();
}

Result<std::vector<HostAddress>> look_up_host(const std::string& host, std::uint16_t port) {
  return addresses_of(host, port, 0);
}

struct HostAddresses::Shared {
  std::string host;
  std::uint16_t port = 0;
  bool literal = false;

  std::mutex mutex;
  std::condition_variable answered;
  std::vector<HostAddress> addresses;
  std::string fault = "no address: the name service has not answered yet";
  bool running = false;
  std::optional<std::chrono::steady_clock::time_point> begun;

  void keep(Result<std::vector<HostAddress>> found) {
    const std::lock_guard lock(mutex);
    running = false;
    if (!found)
      fault = found.error().text;
    else if (!found->empty())
      addresses = std::move(*found);
    answered.notify_all();
  }
  /// Ends a look-up after an internal error, usually a lack of memory. The known addresses and the
  /// last fault stay.
  void give_up() noexcept {
    const std::lock_guard lock(mutex);
    running = false;
    answered.notify_all();
  }
  /// Runs on a separate thread. The thread inherits the real-time priority of the device thread.
  /// This priority is removed for the name service; if the system refuses this, the thread keeps
  /// it.
  void run(const HostLookUp& look_up) noexcept {
    const sched_param none{};
    (void)::pthread_setschedparam(::pthread_self(), SCHED_OTHER, &none);
    try {
      keep(look_up(host, port));
    } catch (...) {
      give_up();
    }
  }
};

HostAddresses::HostAddresses(std::string host, std::uint16_t port, HostAddressesOptions options)
    : shared_(std::make_shared<Shared>()), options_(std::move(options)) {
  shared_->host = std::move(host);
  shared_->port = port;
  if (auto literal = addresses_of(shared_->host, port, AI_NUMERICHOST)) {
    shared_->literal = true;
    shared_->addresses = std::move(*literal);
    return;
  }

  begin_look_up();
  std::unique_lock lock(shared_->mutex);
  shared_->answered.wait_for(lock, options_.patience, [this] { return !shared_->running; });
}

HostAddresses::~HostAddresses() = default;

void HostAddresses::begin_look_up() {
  {
    const auto now = std::chrono::steady_clock::now();
    const std::lock_guard lock(shared_->mutex);
    if (shared_->running || (shared_->begun && now - *shared_->begun < options_.refresh)) return;
    shared_->running = true;
    shared_->begun = now;
  }

  try {
    // The thread is detached, so that no thread has to wait for a name service when it ends.
    std::thread([shared = shared_, look_up = options_.look_up] { shared->run(look_up); }).detach();
  } catch (const std::system_error& refused) {
    shared_->keep(tl::unexpected{
        Error{ErrorCode::SystemRefused, fmt::format("no address: no thread: {}", refused.what())}});
  } catch (...) {
    shared_->give_up();
    throw;
  }
}

Result<HostAddress> HostAddresses::next() {
  if (!shared_->literal) begin_look_up();
  const std::lock_guard lock(shared_->mutex);
  if (shared_->addresses.empty())
    return tl::unexpected{Error{ErrorCode::Unreachable, shared_->fault}};
  return shared_->addresses[tries_++ % shared_->addresses.size()];
}

}  // namespace abbe::drivers
