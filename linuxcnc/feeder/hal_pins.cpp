// SPDX-License-Identifier: GPL-2.0-or-later
#include "hal_pins.hpp"

#include <hal.h>
#include <rtapi.h>

#include <utility>

namespace abbe::linuxcnc {

struct HalPins::Pins {
  hal_float_t* position[kJoints];  // HAL's types are volatile and cannot be template arguments
  hal_float_t* correction[kJoints];
  hal_bit_t *homed, *valid;
  hal_u32_t *begin, *end;
};

std::optional<HalPins> HalPins::create(std::string& error) {
  const int id = hal_init("abbe-feeder");
  if (id < 0) {
    error = "HAL refuses the component abbe-feeder (code " + std::to_string(id) +
            "): LinuxCNC does not run, or another abbe-linuxcnc-feeder is loaded; after one that "
            "was killed restart LinuxCNC";
    return std::nullopt;
  }

  auto* pins = static_cast<Pins*>(hal_malloc(sizeof(Pins)));
  int refused = pins == nullptr ? -1 : 0;
  for (std::size_t i = 0; refused == 0 && i < kJoints; ++i) {
    const int joint = static_cast<int>(i);
    refused |= hal_pin_float_newf(HAL_IN, &pins->position[i], id, "abbe-feeder.%d.position", joint);
    refused |=
        hal_pin_float_newf(HAL_OUT, &pins->correction[i], id, "abbe-feeder.%d.correction", joint);
  }
  if (refused == 0) {
    refused |= hal_pin_bit_newf(HAL_IN, &pins->homed, id, "abbe-feeder.homed");
    refused |= hal_pin_bit_newf(HAL_OUT, &pins->valid, id, "abbe-feeder.valid");
    refused |= hal_pin_u32_newf(HAL_OUT, &pins->begin, id, "abbe-feeder.sequence-begin");
    refused |= hal_pin_u32_newf(HAL_OUT, &pins->end, id, "abbe-feeder.sequence-end");
  }
  if (refused != 0 || hal_ready(id) != 0) {
    error = "HAL refuses the pins of abbe-feeder";
    hal_exit(id);
    return std::nullopt;
  }
  return HalPins(id, pins);
}

HalPins::HalPins(HalPins&& other) noexcept
    : id_(std::exchange(other.id_, -1)), pins_(other.pins_) {}

HalPins::~HalPins() {
  if (id_ >= 0) hal_exit(id_);
}

HalPins::Triple HalPins::positions_mm() const {
  Triple positions_mm{};
  for (std::size_t i = 0; i < kJoints; ++i) positions_mm[i] = *pins_->position[i];
  return positions_mm;
}

bool HalPins::homed() const {
  return *pins_->homed;
}

void HalPins::write(const Triple& correction_mm, bool valid) {
  const std::uint32_t number = *pins_->end + 1;
  __atomic_store_n(pins_->begin, number, __ATOMIC_RELAXED);
  __atomic_thread_fence(__ATOMIC_RELEASE);

  for (std::size_t i = 0; i < kJoints; ++i) *pins_->correction[i] = correction_mm[i];
  *pins_->valid = valid;
  __atomic_store_n(pins_->end, number, __ATOMIC_RELEASE);
}

}  // namespace abbe::linuxcnc
