#pragma once
/// Configures one encoder, from any state, so that it sends its position at every SYNC
/// [CiA 301: PDO configuration order]. Sans-I/O like the SdoClient that it uses: frames and a time
/// in, frames out. No allocation. Not thread-safe.
///
/// Order of the steps:
/// - NMT pre-operational
/// - read and check 1000h and 1018h
/// - read and check the measuring step (6005h:01, else 6501h; rotary: 6001h if scaling is on in
///   6000h, else 6501h)
/// - disable the TPDO, clear its mapping, map the position, set the number of entries
/// - set transmission type, inhibit time and event timer
/// - enable the TPDO
/// - set the heartbeat, disable the other default TPDO
/// - NMT start
///
/// If an encoder refuses a write, the object is read instead. A fixed mapping, transmission type or
/// identifier is accepted if it is the required one. Without a configurable heartbeat, the encoder
/// is monitored by its positions.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/pdo.hpp"
#include "abbe/protocol/can/sdo.hpp"
#include "abbe/protocol/can/sdo_client.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::protocol::can {

/// Required behaviour and identity of the encoder.
struct EncoderPlan {
  NodeId node = 1;
  PositionType position = PositionType::Signed32;
  std::uint8_t tpdo = 1;        ///< 1 or 2
  std::uint8_t sync_every = 1;  ///< 1..240: send at every n-th SYNC (transmission type)
  std::uint16_t heartbeat_ms = 100;
  std::optional<std::uint32_t> vendor{};  ///< checked against 1018h if given
  std::optional<std::uint32_t> product{};
  std::optional<std::uint32_t> serial{};
  std::optional<bool> linear{};  ///< checked against 1000h if given
  bool needs_scale = false;      ///< a node that reports no step, or 0, is refused
  /// Linear encoders: required step, with a tolerance of 0.5 nm; checked if the node reports its
  /// step.
  std::optional<double> step_nm{};
  /// Rotary encoders: required units per revolution, with a relative tolerance of 1e-5; checked if
  /// the node reports them.
  std::optional<double> units_per_revolution{};
};

/// One SDO write of the procedure.
struct SdoWrite {
  ObjectId object;
  std::uint32_t value = 0;
  std::uint8_t size = 0;
  bool optional = false;  ///< a node without this object is accepted
};
/// All SDO writes of the procedure: from disabling the TPDO in use to disabling the other default
/// TPDO.
using PdoConfiguration = std::array<SdoWrite, 10>;
[[nodiscard]] PdoConfiguration pdo_configuration(const EncoderPlan& plan) noexcept;

/// Data read from the encoder.
struct EncoderDescription {
  std::uint32_t device_type = 0;
  std::uint32_t vendor = 0;
  std::uint32_t product = 0;
  std::uint32_t revision = 0;
  std::uint32_t serial = 0;
  std::optional<std::uint32_t> step_nm;  ///< linear, as read; the caller must check for 0
  std::optional<std::uint32_t> operating_parameters;  ///< rotary: 6000h
  std::optional<std::uint32_t> units_per_revolution;  ///< rotary
  /// rotary: number of counts after which the position wraps to 0
  std::optional<std::uint32_t> total_range;
  std::optional<std::uint32_t> revolutions;  ///< rotary without scaling: 6502h
  bool fixed_mapping = false;                ///< the mapping is fixed and contains the position
  std::uint8_t position_byte = 0;            ///< offset of the position in the TPDO
};

enum class ConfigurationFault : std::uint8_t {
  None,
  Silent,          ///< no answer, all retries used
  Refused,         ///< SDO abort by the node: `abort_code`
  NotAnEncoder,    ///< the profile in 1000h is not 406: `seen`
  WrongVendor,     ///< `seen`
  WrongProduct,    ///< `seen`
  WrongSerial,     ///< `seen`
  WrongKind,       ///< linear instead of rotary, or rotary instead of linear: `seen`
  NoScale,         ///< the step is 0 or unknown, and needed
  WrongStep,       ///< differs from the configured step: `seen`
  FixedMapping,    ///< the mapping is fixed and does not contain the position
  FixedType,       ///< the transmission type is fixed and not at every SYNC: `seen`
  NotOperational,  ///< the node left Operational after its configuration
  BadAnswer,       ///< an answer that is not a number, or a protocol error
};
struct ConfigurationError {
  ConfigurationFault fault = ConfigurationFault::None;
  ObjectId object;
  AbortCode abort_code = AbortCode::None;
  std::uint32_t seen = 0;
};
/// Text of a fault: "does not answer", "refused", ... Static storage.
[[nodiscard]] const char* to_text(ConfigurationFault fault) noexcept;

class EncoderConfigurator {
 public:
  enum class State : std::uint8_t { Idle, Working, Ready, Failed };

  explicit EncoderConfigurator(const EncoderPlan& plan, SdoClientOptions options = {}) noexcept;

  void start(HostTime now) noexcept;
  void on_frame(const CanFrame& frame, HostTime now) noexcept;
  void on_time(HostTime now) noexcept;
  /// The next frame to send. Call it until it returns nullopt.
  [[nodiscard]] std::optional<CanFrame> take_frame() noexcept;

  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] HostTime deadline() const noexcept { return sdo_.deadline(); }
  [[nodiscard]] const EncoderPlan& plan() const noexcept { return plan_; }
  [[nodiscard]] const EncoderDescription& description() const noexcept { return description_; }
  [[nodiscard]] const ConfigurationError& error() const noexcept { return error_; }

 private:
  enum class Step : std::uint8_t {
    DeviceType,
    Vendor,
    Product,
    Revision,
    Serial,
    Operating,
    Scale,
    ScaleFallback,
    Range,
    Revolutions,
    Write,
    MappingCount,  ///< this step and the following read an object whose write was refused
    MappingEntry,
    FirstEntry,
    Type,
    CobId,
    Heartbeat,
  };

  void advance(HostTime now) noexcept;
  void begin_step(HostTime now) noexcept;
  void next_step(HostTime now) noexcept;
  [[nodiscard]] bool scale_known() const noexcept;
  void check_device_type(std::uint32_t value) noexcept;
  void check_step() noexcept;
  [[nodiscard]] bool scaling_off() const noexcept;
  [[nodiscard]] Step after_scale() const noexcept;
  [[nodiscard]] bool read_instead() noexcept;
  void take_mapping(std::uint32_t value) noexcept;
  [[nodiscard]] bool is_position(std::uint32_t entry) const noexcept;
  void next_write() noexcept;
  void fail_as_refused() noexcept;
  void write_number(const SdoWrite& write, HostTime now) noexcept;
  [[nodiscard]] bool take_number(std::uint32_t value) noexcept;
  [[nodiscard]] bool tolerated() const noexcept;
  void fail(ConfigurationFault fault, std::uint32_t seen) noexcept;

  EncoderPlan plan_;
  SdoClient sdo_;
  PdoConfiguration writes_;
  EncoderDescription description_;
  ConfigurationError error_;
  State state_ = State::Idle;
  Step step_ = Step::DeviceType;
  std::size_t write_index_ = 0;
  ConfigurationError refusal_;   ///< refused write whose object is read instead
  std::uint8_t mapped_ = 0;      ///< number of entries of the fixed mapping
  std::uint8_t entry_ = 0;       ///< entry being read
  unsigned bits_before_ = 0;     ///< bits of the entries before the position
  std::optional<CanFrame> nmt_;  ///< sent before the frames of the SDO client
};

}  // namespace abbe::protocol::can
