#include "abbe/protocol/can/object_dictionary.hpp"

#include <algorithm>

#include "can/little_endian.hpp"

namespace abbe::protocol::can {

namespace {

constexpr std::uint8_t kMaxMapped = 8;
constexpr std::size_t kMaxPdoBits = 64;
constexpr std::uint8_t kErrorsKept = 4;
constexpr std::uint16_t kDefaultTimerMs = 100;

/// Number of the TPDO: 1 if `index` is `base`, 2 if it is base + 1; nullopt for any other index.
std::optional<unsigned> pdo_of(std::uint16_t index, std::uint16_t base) noexcept {
  if (index < base || index > base + 1) return std::nullopt;
  return static_cast<unsigned>(index - base + 1);
}
ObjectId tpdo_parameter(unsigned number, std::uint8_t sub) noexcept {
  return {static_cast<std::uint16_t>(object::kTpdoParameters + number - 1), sub};
}
ObjectId tpdo_mapping(unsigned number, std::uint8_t sub) noexcept {
  return {static_cast<std::uint16_t>(object::kTpdoMapping + number - 1), sub};
}

bool may_be_mapped(std::uint16_t index) noexcept {
  switch (index) {
    case 0x6004:
    case 0x6008:
    case 0x6020:
    case 0x6030:
    case 0x6500:
    case 0x6503:
    case 0x6504:
    case 0x6505:
      return true;
    default:
      return false;
  }
}

}  // namespace

ObjectDictionary::ObjectDictionary(const EncoderIdentity& identity) noexcept : identity_(identity) {
  name_size_ = std::min(identity.name.size(), name_.size());
  std::copy_n(std::as_bytes(std::span{identity.name}).begin(), name_size_, name_.begin());
  identity_.name = {};
  reset();
}

void ObjectDictionary::reset() noexcept {
  add_communication_objects();
  add_tpdo(1, 254);
  add_tpdo(2, 1);
  add_profile_objects();
  update_position();
}

void ObjectDictionary::add_communication_objects() noexcept {
  const auto type = object::device_type_of(identity_.kind);
  add_number(object::kDeviceType, Access::ReadOnly, type, 4);
  add_number(object::kErrorRegister, Access::ReadOnly, 0, 1);
  add_number(object::kErrorHistory, Access::ReadWrite, 0, 1);

  for (std::uint8_t sub = 1; sub <= kErrorsKept; ++sub)
    add_number({0x1003, sub}, Access::ReadOnly, 0, 4);
  add_number(object::kSyncCobId, Access::ReadWrite, cob::kSync, 4);
  add(object::kDeviceName, Access::ReadOnly, std::span{name_}.first(name_size_));
  add_number(object::kHeartbeatTime, Access::ReadWrite, 0, 2);
  add_number({0x1018, 0}, Access::ReadOnly, 4, 1);
  add_number(object::kVendor, Access::ReadOnly, identity_.vendor, 4);
  add_number(object::kProduct, Access::ReadOnly, identity_.product, 4);
  add_number(object::kRevision, Access::ReadOnly, identity_.revision, 4);
  add_number(object::kSerial, Access::ReadOnly, identity_.serial, 4);
  add_number({object::kSdoServer, 0}, Access::ReadOnly, 2, 1);
  add_number({object::kSdoServer, 1}, Access::ReadOnly, cob::kSdoRequest + identity_.node, 4);
  add_number({object::kSdoServer, 2}, Access::ReadOnly, cob::kSdoResponse + identity_.node, 4);
}

void ObjectDictionary::add_tpdo(unsigned number, std::uint8_t transmission_type) noexcept {
  const auto cob_id = cob::tpdo(number, identity_.node) | object::kPdoNoRemote;
  add_number(tpdo_parameter(number, 0), Access::ReadOnly, 5, 1);
  add_number(tpdo_parameter(number, 1), Access::ReadWrite, cob_id, 4);
  add_number(tpdo_parameter(number, 2), Access::ReadWrite, transmission_type, 1);
  add_number(tpdo_parameter(number, 3), Access::ReadWrite, 0, 2);
  add_number(tpdo_parameter(number, 5), Access::ReadWrite, number == 1 ? kDefaultTimerMs : 0, 2);
  add_number(tpdo_mapping(number, 0), Access::ReadWrite, 1, 1);
  const auto position = encode_mapping(mapped_position(PositionType::Signed32));
  for (std::uint8_t sub = 1; sub <= kMaxMapped; ++sub) {
    add_number(tpdo_mapping(number, sub), Access::ReadWrite, sub == 1 ? position : 0, 4);
  }
}

void ObjectDictionary::add_profile_objects() noexcept {
  const bool linear = object::is_linear(object::device_type_of(identity_.kind));
  add_number(object::kOperatingParameters, Access::ReadWrite, 0, 2);
  add_number(object::kTotalRange, Access::ReadWrite, identity_.total_range, 4);
  add_number(object::kPreset, Access::ReadWrite, 0, 4);
  add_number(object::kPosition, Access::ReadOnly, 0, 4);

  if (linear) {
    add_number({0x6005, 0}, Access::ReadOnly, 1, 1);
    add_number(object::kPositionStep, Access::ReadWrite, identity_.step_nm, 4);
    add_number({0x6020, 0}, Access::ReadOnly, 1, 1);
    add_number(object::kMultiPosition, Access::ReadOnly, 0, 4);
    add_number({0x6030, 0}, Access::ReadOnly, 1, 1);
    add_number({0x6030, 1}, Access::ReadOnly, 0, 2);
  } else {
    add_number(object::kUnitsPerRevolution, Access::ReadWrite, identity_.units_per_revolution, 4);
    const auto revolutions = identity_.total_range / identity_.units_per_revolution;
    add_number(object::kRevolutions, Access::ReadOnly, std::clamp(revolutions, 1u, 0xFFFFu), 2);
  }

  if (identity_.has_position64) {
    add_number(object::kPosition64, Access::ReadOnly, 0, 8);
    add_number(object::kPreset64, Access::ReadWrite, 0, 8);
  }

  add_number(object::kCyclicTimer, Access::ReadWrite, kDefaultTimerMs, 2);
  add_number(object::kOperatingStatus, Access::ReadOnly, 0, 2);
  const auto step = linear ? identity_.step_nm : identity_.units_per_revolution;
  add_number(object::kMeasuringStep, Access::ReadOnly, step, 4);
  add_number(object::kAlarms, Access::ReadOnly, 0, 2);
  add_number(object::kSupportedAlarms, Access::ReadOnly, 1, 2);
  add_number(object::kWarnings, Access::ReadOnly, 0, 2);
  add_number(object::kSupportedWarnings, Access::ReadOnly, 0, 2);
  add_number(object::kProfileVersion, Access::ReadOnly, 0x03010000, 4);
  add_number(object::kOffset, Access::ReadOnly, 0, 4);
}

ObjectDictionary::Entry* ObjectDictionary::find(ObjectId object) noexcept {
  const auto end = entries_.begin() + static_cast<std::ptrdiff_t>(count_);
  const auto it =
      std::find_if(entries_.begin(), end, [&](const Entry& e) { return e.id == object; });
  return it == end ? nullptr : &*it;
}
const ObjectDictionary::Entry* ObjectDictionary::find(ObjectId object) const noexcept {
  const auto end = entries_.begin() + static_cast<std::ptrdiff_t>(count_);
  const auto it =
      std::find_if(entries_.begin(), end, [&](const Entry& e) { return e.id == object; });
  return it == end ? nullptr : &*it;
}
bool ObjectDictionary::has_index(std::uint16_t index) const noexcept {
  const auto end = entries_.begin() + static_cast<std::ptrdiff_t>(count_);
  return std::any_of(entries_.begin(), end, [&](const Entry& e) { return e.id.index == index; });
}

bool ObjectDictionary::add(ObjectId object, Access access, std::span<const std::byte> value,
                           bool any_length) noexcept {
  if (value.size() > kMaxSdoBytes) return false;
  auto* entry = find(object);
  if (entry == nullptr) {
    if (count_ == kCapacity) return false;
    entry = &entries_[count_++];
  }
  entry->id = object;
  entry->access = access;
  entry->any_length = any_length;
  entry->size = static_cast<std::uint8_t>(value.size());
  std::copy(value.begin(), value.end(), entry->value.begin());
  return true;
}

void ObjectDictionary::add_number(ObjectId object, Access access, std::uint64_t value,
                                  std::size_t size) noexcept {
  std::array<std::byte, 8> bytes{};
  store_le(std::span{bytes}, 0, value);
  add(object, access, std::span{bytes}.first(size));
}

std::optional<std::uint64_t> ObjectDictionary::number(ObjectId object) const noexcept {
  const auto* entry = find(object);
  if (entry == nullptr || entry->size == 0 || entry->size > sizeof(std::uint64_t))
    return std::nullopt;
  return load_le<std::uint64_t>(entry->value, 0, entry->size);
}

bool ObjectDictionary::set_number(ObjectId object, std::uint64_t value) noexcept {
  auto* entry = find(object);
  if (entry == nullptr || entry->size > sizeof(std::uint64_t)) return false;
  store_le(std::span{entry->value}, 0, value, entry->size);
  return true;
}

AbortCode ObjectDictionary::may_read(ObjectId object) const noexcept {
  const auto* entry = find(object);
  if (entry == nullptr)
    return has_index(object.index) ? AbortCode::NoSubindex : AbortCode::NoObject;
  return entry->access == Access::WriteOnly ? AbortCode::WriteOnly : AbortCode::None;
}

AbortCode ObjectDictionary::may_write(ObjectId object) const noexcept {
  const auto* entry = find(object);
  if (entry == nullptr)
    return has_index(object.index) ? AbortCode::NoSubindex : AbortCode::NoObject;
  return entry->access == Access::ReadOnly ? AbortCode::ReadOnly : AbortCode::None;
}

AbortCode ObjectDictionary::read(ObjectId object, std::span<std::byte> out,
                                 std::size_t& size) const noexcept {
  const auto code = may_read(object);
  if (code != AbortCode::None) return code;
  const auto* entry = find(object);
  if (entry->size > out.size()) return AbortCode::OutOfMemory;
  size = entry->size;
  std::copy_n(entry->value.begin(), size, out.begin());
  return AbortCode::None;
}

AbortCode ObjectDictionary::write(ObjectId object, std::span<const std::byte> value) noexcept {
  auto code = may_write(object);
  if (code != AbortCode::None) return code;
  auto* entry = find(object);
  if (value.size() > kMaxSdoBytes) return AbortCode::TooLong;
  if (!entry->any_length && value.size() > entry->size) return AbortCode::TooLong;
  if (!entry->any_length && value.size() < entry->size) return AbortCode::TooShort;
  const auto number =
      value.size() <= sizeof(std::uint64_t) ? load_le<std::uint64_t>(value, 0, value.size()) : 0;
  code = check_value(object, number);
  if (code != AbortCode::None) return code;
  entry->size = static_cast<std::uint8_t>(value.size());
  std::copy(value.begin(), value.end(), entry->value.begin());
  after_write(object, number);

  return AbortCode::None;
}

AbortCode ObjectDictionary::check_value(ObjectId object, std::uint64_t value) const noexcept {
  if (object == object::kErrorHistory)
    return value == 0 ? AbortCode::None : AbortCode::InvalidValue;
  if (object == object::kPositionStep || object == object::kUnitsPerRevolution) {
    return value == 0 ? AbortCode::ValueTooLow : AbortCode::None;
  }
  if (pdo_of(object.index, object::kTpdoParameters)) return check_tpdo_parameter(object, value);
  if (pdo_of(object.index, object::kTpdoMapping)) return check_mapping(object, value);
  return AbortCode::None;
}

AbortCode ObjectDictionary::check_tpdo_parameter(ObjectId object,
                                                 std::uint64_t value) const noexcept {
  const auto pdo = tpdo(*pdo_of(object.index, object::kTpdoParameters));
  switch (object.sub) {
    case 1: {
      const auto cob_id = value & CanFrame::kExtendedMask;
      const bool enable = (value & object::kPdoDisabled) == 0;
      if (cob_id == 0 || cob_id > CanFrame::kStandardMask) return AbortCode::InvalidValue;
      if (enable && pdo.enabled && cob_id != pdo.cob_id) return AbortCode::InvalidValue;
      if (enable && pdo.mapped == 0) return AbortCode::InvalidValue;
      return AbortCode::None;
    }
    case 2:
      return value > 240 && value < 254 ? AbortCode::InvalidValue : AbortCode::None;
    case 3:
      return pdo.enabled ? AbortCode::UnsupportedAccess : AbortCode::None;
    default:
      return AbortCode::None;
  }
}

AbortCode ObjectDictionary::check_mapping(ObjectId object, std::uint64_t value) const noexcept {
  const auto number_of_pdo = *pdo_of(object.index, object::kTpdoMapping);
  const auto pdo = tpdo(number_of_pdo);
  if (pdo.enabled) return AbortCode::UnsupportedAccess;

  if (object.sub != 0) {
    if (pdo.mapped != 0) return AbortCode::UnsupportedAccess;
    const auto line = decode_mapping(static_cast<std::uint32_t>(value));
    const auto* target = find({line.index, line.sub});
    const bool fits = target != nullptr && line.bits == target->size * 8;
    return value == 0 || (fits && may_be_mapped(line.index)) ? AbortCode::None
                                                             : AbortCode::NotMappable;
  }

  if (value > kMaxMapped) return AbortCode::ValueTooHigh;
  std::size_t bits = 0;
  for (std::uint8_t sub = 1; sub <= static_cast<std::uint8_t>(value); ++sub) {
    const auto line = number(tpdo_mapping(number_of_pdo, sub)).value_or(0);
    if (line == 0) return AbortCode::NotMappable;
    bits += line & 0xFF;
  }

  return bits > kMaxPdoBits ? AbortCode::PdoLength : AbortCode::None;
}

void ObjectDictionary::after_write(ObjectId object, std::uint64_t value) noexcept {
  if (object == object::kPreset || object == object::kPreset64) {
    const bool linear = object::is_linear(object::device_type_of(identity_.kind));
    const auto wide = object == object::kPreset64 ? static_cast<std::int64_t>(value)
                      : linear                    ? static_cast<std::int32_t>(value)
                                                  : static_cast<std::int64_t>(value);
    offset_ = wide - raw_position_;
    update_position();
  } else if (object == object::kCyclicTimer) {
    set_number(tpdo_parameter(1, 5), value);
  } else if (object == tpdo_parameter(1, 5)) {
    set_number(object::kCyclicTimer, value);
  } else if (object == object::kOperatingParameters) {
    set_number(object::kOperatingStatus, value);
  } else if (object == object::kErrorHistory) {
    for (std::uint8_t sub = 1; sub <= kErrorsKept; ++sub) set_number({0x1003, sub}, 0);
  }
}

void ObjectDictionary::set_raw_position(std::int64_t count) noexcept {
  raw_position_ = count;
  update_position();
}

void ObjectDictionary::update_position() noexcept {
  const auto value = static_cast<std::uint64_t>(position());
  set_number(object::kPosition, value);
  set_number(object::kPosition64, value);
  set_number(object::kMultiPosition, value);
  set_number(object::kOffset, static_cast<std::uint64_t>(offset_));
}

TpdoSettings ObjectDictionary::tpdo(unsigned number_of_pdo) const noexcept {
  TpdoSettings settings;
  const auto parameter = [&](std::uint8_t sub) {
    return number(tpdo_parameter(number_of_pdo, sub)).value_or(0);
  };

  const auto cob_id = number(tpdo_parameter(number_of_pdo, 1)).value_or(object::kPdoDisabled);
  settings.enabled = (cob_id & object::kPdoDisabled) == 0;
  settings.cob_id = static_cast<std::uint32_t>(cob_id & CanFrame::kStandardMask);
  settings.transmission_type = static_cast<std::uint8_t>(parameter(2));
  settings.inhibit_100us = static_cast<std::uint16_t>(parameter(3));
  settings.event_timer_ms = static_cast<std::uint16_t>(parameter(5));
  const auto mapped = number(tpdo_mapping(number_of_pdo, 0)).value_or(0);
  settings.mapped = static_cast<std::uint8_t>(std::min<std::uint64_t>(mapped, kMaxMapped));

  for (std::uint8_t i = 0; i < settings.mapped; ++i) {
    const auto line =
        number(tpdo_mapping(number_of_pdo, static_cast<std::uint8_t>(i + 1))).value_or(0);
    settings.mapping[i] = decode_mapping(static_cast<std::uint32_t>(line));
  }

  return settings;
}

CanFrame ObjectDictionary::tpdo_frame(unsigned number_of_pdo) const noexcept {
  const auto settings = tpdo(number_of_pdo);
  auto frame = standard_frame(settings.cob_id, std::span<const std::byte>{});
  std::size_t used = 0;
  for (std::uint8_t i = 0; i < settings.mapped; ++i) {
    const auto line = settings.mapping[i];
    const std::size_t bytes = std::min<std::size_t>(line.bits / 8u, sizeof(std::uint64_t));
    if (used + bytes > CanFrame::kMaxClassicData) break;
    store_le(std::span{frame.data}, used, number({line.index, line.sub}).value_or(0), bytes);
    used += bytes;
  }
  frame.length = static_cast<std::uint8_t>(used);
  return frame;
}

void ObjectDictionary::record_error(std::uint16_t code, std::uint8_t error_register) noexcept {
  set_number(object::kErrorRegister, error_register);
  if (code == 0) return;
  for (std::uint8_t sub = kErrorsKept; sub > 1; --sub) {
    set_number({0x1003, sub}, number({0x1003, static_cast<std::uint8_t>(sub - 1)}).value_or(0));
  }
  set_number({0x1003, 1}, code);
  const auto kept =
      std::min<std::uint64_t>(number(object::kErrorHistory).value_or(0) + 1, kErrorsKept);
  set_number(object::kErrorHistory, kept);
}

}  // namespace abbe::protocol::can
