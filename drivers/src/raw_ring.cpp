#include "abbe/drivers/raw_ring.hpp"

namespace abbe::drivers {

RawRing::RawRing(std::size_t capacity_blocks)
    : indices_(capacity_blocks), blocks_(indices_.capacity()) {}

}  // namespace abbe::drivers
