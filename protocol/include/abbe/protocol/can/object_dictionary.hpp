#pragma once
/// The object dictionary of one encoder, server side: values, access rights and the rules of PDO
/// configuration [CiA 301, CiA 406]. For simulators and tests. Fixed size, no allocation. Not
/// thread-safe.
///
/// Rules in addition to access rights:
/// - A mapping (1A00h) can be changed only while its PDO is disabled, its entries only while
///   sub-index 0 is 0.
/// - The identifier of a PDO can be changed only while the PDO is disabled.
/// - Only 6004h, 6008h, 6020h, 6030h, 6500h and 6503h..6505h can be mapped.
/// - Writing 6003h or 6009h sets the position. 6200h is an alias of 1800h:05.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/cia406.hpp"
#include "abbe/protocol/can/pdo.hpp"
#include "abbe/protocol/can/sdo.hpp"

namespace abbe::protocol::can {

enum class Access : std::uint8_t { ReadOnly, WriteOnly, ReadWrite };

/// Factory state of an encoder.
struct EncoderIdentity {
  NodeId node = 1;
  object::EncoderKind kind = object::EncoderKind::AbsoluteLinear;
  std::uint32_t vendor = 0;
  std::uint32_t product = 0;
  std::uint32_t revision = 0;
  std::uint32_t serial = 0;
  std::string_view name = "abbe encoder";        ///< 1008h, at most kMaxSdoBytes
  std::uint32_t step_nm = 10;                    ///< 6005h:01, linear; 10 nm: +-21.47 m in 32 bits
  std::uint32_t units_per_revolution = 1 << 20;  ///< 6001h and 6501h, rotary; not 0
  std::uint32_t total_range = 0x7FFFFFFF;  ///< 6002h; rotary: 6502h is the whole revolutions in it
  bool has_position64 = true;              ///< 6008h, 6009h exist (CiA 406 v3.1)
};

/// Present configuration of a TPDO.
struct TpdoSettings {
  bool enabled = false;
  std::uint32_t cob_id = 0;            ///< 11 bits
  std::uint8_t transmission_type = 0;  ///< 0 acyclic, 1..240 every n-th SYNC, 254/255 event
  std::uint16_t inhibit_100us = 0;
  std::uint16_t event_timer_ms = 0;
  std::uint8_t mapped = 0;  ///< number of valid entries of `mapping`
  std::array<MappedObject, 8> mapping{};
};

class ObjectDictionary {
 public:
  static constexpr std::size_t kCapacity = 128;

  explicit ObjectDictionary(const EncoderIdentity& identity) noexcept;

  // Access by SDO, under all rules. AbortCode::None: the access is accepted.
  [[nodiscard]] AbortCode write(ObjectId object, std::span<const std::byte> value) noexcept;
  /// Reads an object: copies its value into `out` (kMaxSdoBytes are sufficient) and sets `size`.
  [[nodiscard]] AbortCode read(ObjectId object, std::span<std::byte> out,
                               std::size_t& size) const noexcept;
  /// AbortCode::None if the access rights permit reading (writing) the object. may_write() does not
  /// check the value.
  [[nodiscard]] AbortCode may_read(ObjectId object) const noexcept;
  [[nodiscard]] AbortCode may_write(ObjectId object) const noexcept;

  // Access by the simulated device itself, without rules.
  /// Adds an object, or replaces it; false when the dictionary is full or the value too long.
  bool add(ObjectId object, Access access, std::span<const std::byte> value,
           bool any_length = false) noexcept;
  [[nodiscard]] std::optional<std::uint64_t> number(ObjectId object) const noexcept;
  /// Sets a number in the object's own width; false if there is no such object.
  bool set_number(ObjectId object, std::uint64_t value) noexcept;

  /// Sets the measured position in counts, without preset; updates 6004h, 6008h and 6020h:01.
  void set_raw_position(std::int64_t count) noexcept;
  /// The position in counts, preset included.
  [[nodiscard]] std::int64_t position() const noexcept { return raw_position_ + offset_; }

  [[nodiscard]] TpdoSettings tpdo(unsigned number) const noexcept;  ///< number 1 or 2
  /// The TPDO with present values, according to its mapping. Unknown objects in the mapping give
  /// zeros.
  [[nodiscard]] CanFrame tpdo_frame(unsigned number) const noexcept;

  /// Stores the error in 1001h and as newest entry of 1003h (which holds four); code 0 clears 1001h
  /// only.
  void record_error(std::uint16_t code, std::uint8_t error_register) noexcept;
  /// Restores the factory values of all writable objects (NMT reset node). The offset of the preset
  /// is kept: encoders store it permanently.
  void reset() noexcept;

 private:
  struct Entry {
    ObjectId id;
    Access access = Access::ReadOnly;
    bool any_length = false;
    std::uint8_t size = 0;
    std::array<std::byte, kMaxSdoBytes> value{};
  };

  void add_number(ObjectId object, Access access, std::uint64_t value, std::size_t size) noexcept;
  void add_communication_objects() noexcept;
  void add_tpdo(unsigned number, std::uint8_t transmission_type) noexcept;
  void add_profile_objects() noexcept;
  void update_position() noexcept;
  [[nodiscard]] Entry* find(ObjectId object) noexcept;
  [[nodiscard]] const Entry* find(ObjectId object) const noexcept;
  [[nodiscard]] bool has_index(std::uint16_t index) const noexcept;
  [[nodiscard]] AbortCode check_value(ObjectId object, std::uint64_t value) const noexcept;
  [[nodiscard]] AbortCode check_tpdo_parameter(ObjectId object, std::uint64_t value) const noexcept;
  [[nodiscard]] AbortCode check_mapping(ObjectId object, std::uint64_t value) const noexcept;
  void after_write(ObjectId object, std::uint64_t value) noexcept;

  EncoderIdentity identity_;  ///< its name is copied to `name_`
  std::array<std::byte, kMaxSdoBytes> name_{};
  std::size_t name_size_ = 0;
  std::array<Entry, kCapacity> entries_{};
  std::size_t count_ = 0;
  std::int64_t raw_position_ = 0;
  std::int64_t offset_ = 0;
};

}  // namespace abbe::protocol::can
