#include "abbe/drivers/environment/modbus_line.hpp"

#include <fmt/format.h>
#include <modbus/modbus.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::drivers {
namespace {

using std::chrono::nanoseconds;

constexpr int kDataBits = 8;  // RTU always has 8 data bits

tl::unexpected<Error> failed(std::string_view what, int error) {
  const auto code = error == ETIMEDOUT ? ErrorCode::Timeout : ErrorCode::Unreachable;
  return tl::unexpected(Error{code, fmt::format("{}: {}", what, modbus_strerror(error))});
}

modbus_t* make_context(const ModbusAddress& address, const std::string& tcp_address) {
  if (const auto* tcp = std::get_if<ModbusTcp>(&address))
    return modbus_new_tcp_pi(tcp_address.c_str(), std::to_string(tcp->port).c_str());
  const auto& serial = std::get<ModbusSerial>(address);
  return modbus_new_rtu(serial.path.c_str(), serial.baud, static_cast<char>(serial.parity),
                        kDataBits, serial.stop_bits);
}

bool becomes_readable(int fd, nanoseconds wall) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const auto ns = std::max<std::int64_t>(wall.count(), 0);
  const timespec timeout{static_cast<time_t>(ns / kSecond), static_cast<long>(ns % kSecond)};
  pollfd poll{fd, POLLIN, 0};
  return ppoll(&poll, 1, &timeout, nullptr) > 0;  // false also if a signal interrupts the wait
}

}  // namespace

modbus::Transport transport_of(const ModbusAddress& address) noexcept {
  return std::holds_alternative<ModbusTcp>(address) ? modbus::Transport::Tcp
                                                    : modbus::Transport::Rtu;
}

std::string text_of(const ModbusAddress& address) {
  if (const auto* tcp = std::get_if<ModbusTcp>(&address))
    return fmt::format("{}:{}", tcp->host, tcp->port);
  const auto& serial = std::get<ModbusSerial>(address);
  return fmt::format("{} {} {}{}{}", serial.path, serial.baud, kDataBits,
                     static_cast<char>(serial.parity), serial.stop_bits);
}

void ModbusLine::Free::operator()(_modbus* context) const noexcept {
  modbus_close(context);
  modbus_free(context);
}

ModbusLine::ModbusLine() = default;
ModbusLine::~ModbusLine() = default;

Result<void> ModbusLine::open(const ModbusAddress& address, nanoseconds wall) {
  decltype(lock_) lock;
  if (const auto* serial = std::get_if<ModbusSerial>(&address)) ABBE_TRY(lock.take(serial->path));
  std::string tcp_address;
  if (const auto* tcp = std::get_if<ModbusTcp>(&address)) {
    if (!host_) host_.emplace(tcp->host, tcp->port);
    const auto found = host_->next();
    if (!found) return tl::unexpected(Error{found.error().code, "open: " + found.error().text});
    tcp_address = text_of(*found);
  }
  decltype(context_) fresh{make_context(address, tcp_address)};
  if (!fresh) return failed("configure", errno);

  // The response time-out of libmodbus also limits connecting. It must not be below 1 us.
  const auto us = std::max<std::int64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(wall).count(), 1);
  constexpr std::int64_t kSecond = 1'000'000;
  modbus_set_response_timeout(fresh.get(), static_cast<std::uint32_t>(us / kSecond),
                              static_cast<std::uint32_t>(us % kSecond));
  if (modbus_connect(fresh.get()) != 0)
    return failed("open", errno == EINPROGRESS ? ETIMEDOUT : errno);
  if (transport_of(address) == modbus::Transport::Rtu) modbus_flush(fresh.get());
  context_ = std::move(fresh);
  lock_ = std::move(lock);

  return {};
}

void ModbusLine::close() noexcept {
  context_.reset();
  lock_ = {};
}

Result<void> ModbusLine::send(const modbus::ReadRequest& request) {
  const auto high = [](std::uint16_t v) { return static_cast<std::uint8_t>(v >> 8); };
  const auto low = [](std::uint16_t v) { return static_cast<std::uint8_t>(v & 0xFFu); };
  const std::array<std::uint8_t, 6> raw{
      request.unit,          static_cast<std::uint8_t>(request.function),
      high(request.address), low(request.address),
      high(request.count),   low(request.count)};
  if (modbus_send_raw_request(context_.get(), raw.data(), static_cast<int>(raw.size())) < 0)
    return failed("send", errno);
  return {};
}

Result<std::size_t> ModbusLine::read(std::span<std::byte> into, nanoseconds wall) {
  const int fd = modbus_get_socket(context_.get());
  if (!becomes_readable(fd, wall)) return std::size_t{0};
  const auto n = ::read(fd, into.data(), into.size());
  if (n > 0) return static_cast<std::size_t>(n);
  if (n < 0 && (errno == EAGAIN || errno == EINTR)) return std::size_t{0};
  return failed("read", n == 0 ? ECONNRESET : errno);
}

}  // namespace abbe::drivers
