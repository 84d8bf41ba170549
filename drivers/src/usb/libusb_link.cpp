#include "abbe/drivers/usb/libusb_link.hpp"

#include <fmt/format.h>
#include <libusb-1.0/libusb.h>

#include <algorithm>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "abbe/protocol/usb/descriptors.hpp"

namespace abbe::drivers {
namespace {

constexpr int kInterface = 0;
constexpr std::size_t kLargestAnswer = usb::kMaxDescriptor;
/// Cancelled transfers normally end immediately, but not if the host controller hangs. close()
/// waits for them for at most this many cycles of kCloseCycle. If transfers are pending after that,
/// each later open() waits for one further cycle.
constexpr int kMostCloseCycles = 20;
constexpr timeval kCloseCycle{0, 50'000};

std::string usb_error_text(int error) {
  return libusb_strerror(static_cast<libusb_error>(error));
}

UsbOutcome outcome_of(libusb_transfer_status status) {
  if (status == LIBUSB_TRANSFER_COMPLETED) return UsbOutcome::Done;
  return status == LIBUSB_TRANSFER_STALL ? UsbOutcome::Stalled : UsbOutcome::Failed;
}

std::string serial_of(libusb_device_handle* handle, std::uint8_t index) {
  std::array<unsigned char, 256> text{};
  if (index == 0) return {};
  const int n =
      libusb_get_string_descriptor_ascii(handle, index, text.data(), static_cast<int>(text.size()));
  return n > 0 ? std::string(text.begin(), text.begin() + n) : std::string{};
}

struct DeviceList {
  explicit DeviceList(libusb_context* context) : count(libusb_get_device_list(context, &devices)) {}
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;
  ~DeviceList() {
    if (count >= 0) libusb_free_device_list(devices, 1);
  }
  [[nodiscard]] std::span<libusb_device*> all() const {
    return {devices, count < 0 ? 0 : static_cast<std::size_t>(count)};
  }
  libusb_device** devices = nullptr;
  ssize_t count;
};

}  // namespace

struct LibusbLink::State {
  struct Bulk {
    State* state = nullptr;
    libusb_transfer* transfer = nullptr;
    std::vector<unsigned char> buffer;
    /// resubmitted in the next wait(), because the caller may still read `bytes`
    bool resubmit = false;
  };

  /// A connected device with matching vendor and product, and its bus address.
  struct Seen {
    std::uint8_t bus;
    std::uint8_t address;
    std::string serial;
  };

  State(const UsbIdentity& wanted, const TimeSource& source) : identity(wanted), time(source) {
    init_error = libusb_init(&context);
    if (init_error != 0) return;
    control_transfer = libusb_alloc_transfer(0);
    libusb_hotplug_register_callback(context, LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT,
                                     LIBUSB_HOTPLUG_NO_FLAGS, wanted.vendor, wanted.product,
                                     LIBUSB_HOTPLUG_MATCH_ANY, &State::on_left, this, nullptr);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    if (context == nullptr) return;
    close();
    if (handle != nullptr) return;  // transfers that libusb still owns are not freed
    free_bulk();
    libusb_free_transfer(control_transfer);
    libusb_exit(context);
  }

  [[nodiscard]] std::string name() const {
    return fmt::format("USB {:04X}:{:04X}", identity.vendor, identity.product);
  }

  void lose(ErrorCode code, const std::string& seen) {
    if (!std::exchange(lost, true)) events.emplace_back(UsbLost{Error{code, name() + ": " + seen}});
  }

  void open() {
    close();
    events.clear();
    lost = false;

    if (handle != nullptr) {
      return lose(ErrorCode::Unreachable,
                  "its cancelled transfers have not ended: the USB host controller hangs");
    }

    if (init_error != 0)
      return lose(ErrorCode::SystemRefused, "libusb: " + usb_error_text(init_error));
    if (!find()) return;
    if (!take_over()) {
      libusb_close(std::exchange(handle, nullptr));
      return;
    }

    events.emplace_back(UsbOpened{serial});
  }

  /// Opens the device with the configured serial number. A device of the same kind may be in use by
  /// another program; so each one is opened only once to read its serial number, which is kept
  /// while the device stays connected.
  bool find() {
    const DeviceList list{context};
    std::vector<Seen> there;
    std::string refused;
    libusb_device* ours = nullptr;

    for (libusb_device* device : list.all()) {
      libusb_device_descriptor d{};
      if (libusb_get_device_descriptor(device, &d) != 0) continue;
      if (d.idVendor != identity.vendor || d.idProduct != identity.product) continue;
      auto one = look_at(device, d.iSerialNumber, refused);
      if (!one) continue;
      if (ours == nullptr && wrong_serial(identity, one->serial).empty()) {
        ours = device;
        serial = one->serial;
      }
      there.push_back(std::move(*one));
    }

    cards = std::move(there);
    std::vector<std::string> serials;
    for (const Seen& one : cards) serials.push_back(one.serial);
    if (identity.serial.empty() && serials.size() > 1) ours = nullptr;

    if (ours != nullptr) {
      if (const int error = libusb_open(ours, &handle); error != 0) {
        handle = nullptr;
        serials.clear();
        refused = usb_error_text(error);
      }
    }

    return judge(serials, refused);
  }

  /// Serial numbers are kept per address: a device that is connected again has a new address.
  std::optional<Seen> look_at(libusb_device* device, std::uint8_t serial_string,
                              std::string& refused) const {
    Seen one{libusb_get_bus_number(device), libusb_get_device_address(device), {}};
    const auto known = std::ranges::find_if(cards, [&](const Seen& s) {
      return s.bus == one.bus && s.address == one.address && !s.serial.empty();
    });

    if (known != cards.end()) return *known;
    libusb_device_handle* candidate = nullptr;
    if (const int error = libusb_open(device, &candidate); error != 0) {
      refused = usb_error_text(error);
      return std::nullopt;
    }

    one.serial = serial_of(candidate, serial_string);
    libusb_close(candidate);
    return one;
  }

  bool judge(const std::vector<std::string>& serials, const std::string& refused) {
    if (identity.serial.empty() && serials.size() > 1) {
      lose(ErrorCode::BadConfiguration,
           fmt::format("{} such devices are connected ({}): configure the serial number",
                       serials.size(), fmt::join(serials, ", ")));
    } else if (handle == nullptr && !serials.empty()) {
      lose(ErrorCode::Protocol, fmt::format("its serial number is \"{}\", configured is \"{}\"",
                                            fmt::join(serials, "\", \""), identity.serial));
    } else if (handle == nullptr && !refused.empty()) {
      lose(ErrorCode::SystemRefused, refused + " (access needs a udev rule)");
    } else if (handle == nullptr) {
      lose(ErrorCode::Unreachable, "no such device is connected");
    }

    return handle != nullptr;
  }

  bool take_over() {
    libusb_set_auto_detach_kernel_driver(handle, 1);
    int configuration = 0;
    if (libusb_get_configuration(handle, &configuration) != 0 ||
        configuration != identity.configuration) {
      if (const int error = libusb_set_configuration(handle, identity.configuration); error != 0) {
        lose(ErrorCode::SystemRefused, "configuration: " + usb_error_text(error));
        return false;
      }
    }

    if (const int error = libusb_claim_interface(handle, kInterface); error != 0) {
      lose(ErrorCode::SystemRefused, "interface: " + usb_error_text(error));
      return false;
    }

    if (libusb_get_max_packet_size(libusb_get_device(handle), identity.bulk_endpoint) <= 0) {
      lose(ErrorCode::Protocol, fmt::format("it has no endpoint {:02X}", identity.bulk_endpoint));
      return false;
    }

    return true;
  }

  void close() noexcept {
    if (handle == nullptr) return;
    const bool first = !std::exchange(closing, true);
    if (first) {
      streaming = stopping = false;
      for (auto& bulk : bulks) libusb_cancel_transfer(bulk.transfer);
      if (control_under_way) libusb_cancel_transfer(control_transfer);
    }

    for (int cycle = first ? 0 : kMostCloseCycles - 1; busy() && cycle < kMostCloseCycles;
         ++cycle) {
      timeval timeout = kCloseCycle;
      libusb_handle_events_timeout_completed(context, &timeout, nullptr);
    }

    if (busy()) return;  // still closing: transfers owned by libusb are neither freed nor reused
    libusb_release_interface(handle, kInterface);
    libusb_close(std::exchange(handle, nullptr));
    closing = false;
  }

  [[nodiscard]] bool busy() const noexcept { return in_flight != 0 || control_under_way; }

  void free_bulk() noexcept {
    for (auto& bulk : bulks) libusb_free_transfer(bulk.transfer);
    bulks.clear();
  }

  void control(const usb::Setup& setup) {
    if (handle == nullptr || closing) return;
    control_setup = setup;
    if (setup == usb::clear_halt(identity.bulk_endpoint)) return clear_halt();
    libusb_fill_control_setup(control_buffer.data(), setup.request_type, setup.request, setup.value,
                              setup.index, std::min<std::uint16_t>(setup.length, kLargestAnswer));
    libusb_fill_control_transfer(control_transfer, handle, control_buffer.data(),
                                 &State::on_control, this, 0);
    const int error = libusb_submit_transfer(control_transfer);
    if (error != 0) return lose(ErrorCode::Unreachable, "request: " + usb_error_text(error));
    control_under_way = true;
  }

  /// Clears the halt by libusb, which also resets the data toggle in the host; a plain control
  /// request does not.
  void clear_halt() {
    const int error = libusb_clear_halt(handle, identity.bulk_endpoint);
    if (error == LIBUSB_ERROR_NO_DEVICE) return lose(ErrorCode::Unreachable, usb_error_text(error));
    UsbControlDone done{.setup = control_setup};
    if (error != 0) done.outcome = UsbOutcome::Failed;
    events.emplace_back(done);
  }

  void start_bulk(const UsbBulkStream& stream) {
    if (handle == nullptr || closing || streaming || in_flight != 0) return;
    if (bulks.size() != stream.in_flight || bulks.front().buffer.size() != stream.transfer_bytes) {
      free_bulk();
      bulks.resize(stream.in_flight);
      for (auto& bulk : bulks) {
        bulk.state = this;
        bulk.transfer = libusb_alloc_transfer(0);
        bulk.buffer.resize(stream.transfer_bytes);
      }
    }

    streaming = true;
    for (auto& bulk : bulks) {
      libusb_fill_bulk_transfer(bulk.transfer, handle, identity.bulk_endpoint, bulk.buffer.data(),
                                static_cast<int>(bulk.buffer.size()), &State::on_bulk, &bulk, 0);
      submit(bulk);
    }
  }

  void submit(Bulk& bulk) {
    bulk.resubmit = false;
    const int error = libusb_submit_transfer(bulk.transfer);
    if (error != 0) return lose(ErrorCode::Unreachable, "scan endpoint: " + usb_error_text(error));
    ++in_flight;
  }

  void stop_bulk() {
    if (handle == nullptr || closing) return;
    streaming = false;
    stopping = true;
    for (auto& bulk : bulks) libusb_cancel_transfer(bulk.transfer);
    report_if_stopped();
  }

  void report_if_stopped() {
    if (!stopping || in_flight != 0) return;
    stopping = false;
    events.emplace_back(UsbBulkStopped{});
  }

  std::span<const UsbEvent> wait(std::chrono::nanoseconds wall) {
    delivered.clear();
    if (streaming) {
      for (auto& bulk : bulks)
        if (bulk.resubmit) submit(bulk);
    }
    if (context == nullptr) {
      std::this_thread::sleep_for(wall);
    } else {
      poll(events.empty() ? wall : std::chrono::nanoseconds{0});
    }
    std::swap(delivered, events);
    return delivered;
  }

  void poll(std::chrono::nanoseconds wall) {
    const auto us = std::chrono::duration_cast<std::chrono::microseconds>(wall);
    timeval timeout{us.count() / 1'000'000, us.count() % 1'000'000};
    const int error = libusb_handle_events_timeout_completed(context, &timeout, nullptr);
    if (error != LIBUSB_SUCCESS && error != LIBUSB_ERROR_INTERRUPTED)
      lose(ErrorCode::SystemRefused, "libusb: " + usb_error_text(error));
    if (lost) close();
  }

  static void LIBUSB_CALL on_bulk(libusb_transfer* transfer) {
    auto& bulk = *static_cast<Bulk*>(transfer->user_data);
    State& s = *bulk.state;
    --s.in_flight;

    if (transfer->status == LIBUSB_TRANSFER_NO_DEVICE) {
      if (!s.closing) s.lose(ErrorCode::Unreachable, "unplugged");
    } else if (s.streaming && transfer->status != LIBUSB_TRANSFER_CANCELLED) {
      const auto outcome = outcome_of(transfer->status);
      bulk.resubmit = outcome == UsbOutcome::Done;
      const auto bytes = std::as_bytes(std::span{bulk.buffer});
      s.events.emplace_back(UsbBulkIn{
          bytes.first(static_cast<std::size_t>(transfer->actual_length)), s.time.now(), outcome});
    }

    s.report_if_stopped();
  }

  static void LIBUSB_CALL on_control(libusb_transfer* transfer) {
    State& s = *static_cast<State*>(transfer->user_data);
    s.control_under_way = false;
    if (s.closing) return;
    if (transfer->status == LIBUSB_TRANSFER_NO_DEVICE)
      return s.lose(ErrorCode::Unreachable, "unplugged");
    UsbControlDone done{.setup = s.control_setup, .outcome = outcome_of(transfer->status)};

    if (s.control_setup.device_to_host()) {
      const auto answer =
          std::as_bytes(std::span{s.control_buffer}.subspan(LIBUSB_CONTROL_SETUP_SIZE));
      done.length = std::min(static_cast<std::size_t>(transfer->actual_length), done.data.size());
      std::copy_n(answer.begin(), done.length, done.data.begin());
    }

    s.events.emplace_back(done);
  }

  static int LIBUSB_CALL on_left(libusb_context*, libusb_device* device, libusb_hotplug_event,
                                 void* self) {
    State& s = *static_cast<State*>(self);
    const bool ours = s.handle != nullptr && libusb_get_device(s.handle) == device;
    if (ours && !s.closing) s.lose(ErrorCode::Unreachable, "unplugged");
    return 0;
  }

  UsbIdentity identity;
  const TimeSource& time;
  libusb_context* context = nullptr;
  int init_error = 0;
  libusb_device_handle* handle = nullptr;
  std::vector<Seen> cards;  ///< found by the latest find()
  std::string serial;       ///< serial number of the opened device
  bool closing = false;     ///< close() was called, but transfers have not ended
  bool lost = false;

  usb::Setup control_setup;
  libusb_transfer* control_transfer = nullptr;
  bool control_under_way = false;
  std::array<unsigned char, LIBUSB_CONTROL_SETUP_SIZE + kLargestAnswer> control_buffer{};

  std::vector<Bulk> bulks;
  std::size_t in_flight = 0;
  bool streaming = false;
  bool stopping = false;

  std::vector<UsbEvent> events;     ///< for the next return of wait()
  std::vector<UsbEvent> delivered;  ///< events that the latest wait() returned
};

LibusbLink::LibusbLink(const UsbIdentity& identity, const TimeSource& time)
    : state_(std::make_unique<State>(identity, time)) {}
LibusbLink::~LibusbLink() = default;

void LibusbLink::open() {
  state_->open();
}
void LibusbLink::close() noexcept {
  state_->close();
  state_->events.clear();
}
void LibusbLink::control(const usb::Setup& setup) {
  state_->control(setup);
}
void LibusbLink::start_bulk_in(const UsbBulkStream& stream) {
  state_->start_bulk(stream);
}
void LibusbLink::stop_bulk_in() {
  state_->stop_bulk();
}
std::span<const UsbEvent> LibusbLink::wait(std::chrono::nanoseconds wall) {
  return state_->wait(wall);
}
std::string LibusbLink::name() const {
  return state_->name();
}

}  // namespace abbe::drivers
