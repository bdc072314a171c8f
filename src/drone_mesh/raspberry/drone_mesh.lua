-- Wireshark dissector for the frames of an nRF24L01+ and the packets of drone_mesh.
--
-- USER0 (pcapng link type 147): frames on the air, as --trace writes them. Preamble 8 bits, address
-- 40, packet control field 9 (none in plain ShockBurst), payload 0 or 256, CRC 8 or 16.
-- USER1 (148): payloads of 32 bytes, as `raspberry_radio listen --pcapng` writes them.
--
-- wireshark -X lua_script:drone_mesh.lua FILE

local PAYLOAD_BYTES = 32
local HEADER_BYTES = 5

-- packet types, written by scripts/packet_tables
local types = {
  [0] = "NOTDEFINED",
  [1] = "LOCATION",
  [2] = "REQUESTLOCATION",
  [3] = "PRESENT",
  [4] = "HEARTBEAT",
  [5] = "MISSING",
  [6] = "MOVE_TO_LOCATION",
  [7] = "MOVEMENT_NEGOTIATION",
  [40] = "BEACON",
  [41] = "SEARCH",
  [42] = "FOUND",
  [43] = "PROBE",
  [64] = "ORDER_REPLY",
  [65] = "ORDER_QUERY",
  [66] = "NODE_REPORT",
  [67] = "NODE_WORDS",
  [68] = "NODE_SEARCH",
  [69] = "LAST_PLACE",
  [125] = "GATEWAY_PLACE",
  [126] = "SEAL_CHALLENGE",
  [127] = "SEAL_ANSWER",
}
local bodies = { -- name, form, bytes
  [1] = {
    { "latitude", "float", 4 },
    { "longitude", "float", 4 },
    { "height", "int16", 2 },
    { "timeSincePosix", "uint32", 4 },
  },
  [3] = {
    { "hopsUntilGateway", "uint8", 1 },
    { "knowGateway", "bool", 1 },
  },
  [4] = {
    { "knowGateway", "bool", 1 },
    { "preferredGateway", "uint8", 1 },
    { "hops", "uint8", 1 },
  },
  [5] = {
    { "missing", "uint8", 1 },
  },
  [6] = {
    { "latitude", "float", 4 },
    { "longitude", "float", 4 },
    { "height", "int16", 2 },
  },
  [7] = {
    { "cost", "float", 4 },
  },
  [40] = {
    { "flags", "uint8", 1 },
    { "interval", "uint8", 1 },
    { "gateway", "uint8", 1 },
    { "number", "uint8", 1 },
    { "hops", "uint8", 1 },
    { "parent", "uint8", 1 },
    { "ancestors", "string", 3 },
  },
  [41] = {
    { "node", "uint8", 1 },
    { "number", "uint16", 2 },
    { "hopsLeft", "uint8", 1 },
  },
  [42] = {
    { "node", "uint8", 1 },
  },
  [64] = {
    { "order", "uint16", 2 },
    { "outcome", "uint8", 1 },
    { "part", "uint8", 1 },
    { "text", "string", 10 },
  },
  [65] = {
    { "order", "uint16", 2 },
  },
  [66] = {
    { "neighbours", "uint8", 1 },
    { "hopsUntilGateway", "uint8", 1 },
    { "nextHop", "uint8", 1 },
    { "latitudeSteps", "int16", 2 },
    { "longitudeSteps", "int16", 2 },
    { "heightSteps", "int16", 2 },
    { "battery", "uint8", 1 },
    { "flags", "uint8", 1 },
    { "tries", "uint8", 1 },
  },
  [67] = {
    { "part", "uint8", 1 },
    { "text", "string", 13 },
  },
  [68] = {
    { "node", "uint8", 1 },
    { "number", "uint16", 2 },
  },
  [69] = {
    { "age", "uint16", 2 },
    { "node", "uint8", 1 },
    { "latitude", "float", 4 },
    { "longitude", "float", 4 },
    { "height", "int16", 2 },
  },
  [125] = {
    { "agePlusOne", "uint16", 2 },
    { "gateway", "uint8", 1 },
    { "latitude", "float", 4 },
    { "longitude", "float", 4 },
    { "height", "int16", 2 },
  },
}
-- end of packet types
local outcomes = {
  [1] = "accepted", [2] = "refused", [3] = "arrived", [4] = "given up", [5] = "unknown",
  [6] = "replaced",
}

local mesh = Proto("drone_mesh", "Drone mesh")
local f = {
  creator = ProtoField.uint8("drone_mesh.creator", "Creator"),
  from = ProtoField.uint8("drone_mesh.from", "From"),
  type = ProtoField.uint8("drone_mesh.type", "Type", base.DEC, types),
  to = ProtoField.uint8("drone_mesh.to", "To"),
  forward = ProtoField.uint8("drone_mesh.forward", "Forward"),
  latitude = ProtoField.float("drone_mesh.latitude", "Latitude (m)"),
  longitude = ProtoField.float("drone_mesh.longitude", "Longitude (m)"),
  height = ProtoField.int16("drone_mesh.height", "Height (m)"),
  time = ProtoField.uint32("drone_mesh.time", "Time of the creator (s)"),
  hops = ProtoField.uint8("drone_mesh.hops", "Hops"),
  know_gateway = ProtoField.bool("drone_mesh.know_gateway", "Knows a gateway"),
  gateway = ProtoField.uint8("drone_mesh.gateway", "Preferred gateway"),
  missing = ProtoField.uint8("drone_mesh.missing", "Missing"),
  cost = ProtoField.float("drone_mesh.cost", "Cost (m)"),
  order = ProtoField.uint16("drone_mesh.order", "Order"),
  outcome = ProtoField.uint8("drone_mesh.outcome", "Outcome", base.DEC, outcomes),
  part = ProtoField.uint8("drone_mesh.part", "Part", base.DEC, nil, 0x0f),
  last_part = ProtoField.uint8("drone_mesh.last_part", "Last part", base.DEC, nil, 0xf0),
  text = ProtoField.string("drone_mesh.text", "Text"),
  neighbours = ProtoField.uint8("drone_mesh.neighbours", "Neighbours"),
  next_hop = ProtoField.uint8("drone_mesh.next_hop", "Next hop"),
  place = ProtoField.int16("drone_mesh.place", "Latitude, longitude or height (0.2 m)"),
  battery = ProtoField.uint8("drone_mesh.battery", "Battery (%)"),
  flying = ProtoField.bool("drone_mesh.flying", "In flight", 8, nil, 0x01),
  can_fly = ProtoField.bool("drone_mesh.can_fly", "Can fly", 8, nil, 0x02),
  shares_id = ProtoField.bool("drone_mesh.shares_id", "Another radio uses its id", 8, nil, 0x04),
  tries = ProtoField.uint8("drone_mesh.tries", "Tries per packet (0.1)"),
  below_bytes = ProtoField.uint8("drone_mesh.below_bytes", "Bytes of nodes below", base.DEC, nil, 0x0f),
  has_place = ProtoField.bool("drone_mesh.has_place", "Has a place", 8, nil, 0x10),
  has_digest = ProtoField.bool("drone_mesh.has_digest", "Has a digest of its origin", 8, nil, 0x20),
  has_gateway_place = ProtoField.bool(
    "drone_mesh.has_gateway_place", "Has the gateway's place", 8, nil, 0x40
  ),
  looks = ProtoField.bool("drone_mesh.looks", "Asks for beacons", 8, nil, 0x80),
  interval = ProtoField.uint8("drone_mesh.interval", "Interval (0.05 s)", base.DEC, nil, 0x7f),
  no_internet = ProtoField.bool("drone_mesh.no_internet", "No internet", 8, nil, 0x80),
  beacon_number = ProtoField.uint8("drone_mesh.beacon_number", "Number of the gateway's beacon"),
  ancestors = ProtoField.bytes("drone_mesh.ancestors", "Ancestors"),
  beacon_place = ProtoField.uint16("drone_mesh.beacon_place", "Latitude, longitude or height (0.1 m)"),
  velocity = ProtoField.int8("drone_mesh.velocity", "Velocity (root of it, 50 m/s: 127)"),
  digest = ProtoField.uint16("drone_mesh.digest", "Digest of its origin", base.HEX),
  after = ProtoField.uint8("drone_mesh.after", "Nodes below, after"),
  below = ProtoField.bytes("drone_mesh.below", "Nodes below"),
  data = ProtoField.bytes("drone_mesh.data", "Data"),
  rest = ProtoField.bytes("drone_mesh.rest", "Behind the body"),
}

-- The fields that show a part of a body with this name; most names have a field of their own.
local shown_as = {
  hopsUntilGateway = { f.hops }, knowGateway = { f.know_gateway }, preferredGateway = { f.gateway },
  timeSincePosix = { f.time }, nextHop = { f.next_hop }, part = { f.last_part, f.part },
  latitudeSteps = { f.place }, longitudeSteps = { f.place }, heightSteps = { f.place },
}
local BEACON, NODE_REPORT = 40, 66
local shown_in = { -- names that mean something else in these types
  [BEACON] = {
    flags = { f.below_bytes, f.has_place, f.has_digest, f.has_gateway_place, f.looks },
    interval = { f.interval, f.no_internet },
    number = { f.beacon_number },
    ancestors = { f.ancestors },
  },
  [NODE_REPORT] = { flags = { f.flying, f.can_fly, f.shares_id } },
}

local function fields_of(kind, name)
  return shown_in[kind] and shown_in[kind][name] or shown_as[name]
end

table.insert(bodies[6], { "order", "uint16", 2 }) -- behind the body of a MOVE_TO_LOCATION
for kind, body in pairs(bodies) do
  for _, entry in ipairs(body) do
    local name, form = entry[1], entry[2]
    if not fields_of(kind, name) then
      f[name] = f[name] or ProtoField[form]("drone_mesh." .. name, name)
      shown_as[name] = { f[name] }
    end
  end
end
mesh.fields = f

-- What follows the head of a beacon, as its flags say; returns where the new nodes below begin.
local function add_beacon_parts(tree, tvb, at)
  local flags = tvb(HEADER_BYTES, 1):uint()
  local function add(field, bytes, times)
    for _ = 1, times do
      tree:add_le(field, tvb(at, bytes))
      at = at + bytes
    end
  end
  if math.floor(flags / 0x10) % 2 == 1 then
    add(f.beacon_place, 2, 3)
    add(f.velocity, 1, 3)
  end
  if math.floor(flags / 0x20) % 2 == 1 then
    add(f.digest, 2, 1)
  end
  if math.floor(flags / 0x40) % 2 == 1 then
    add(f.beacon_place, 2, 3)
  end
  local below_bytes = flags % 0x10
  if at + 1 + below_bytes <= PAYLOAD_BYTES then
    add(f.after, 1, 1)
    if below_bytes > 0 then
      add(f.below, below_bytes, 1)
    end
  end
  return at
end

function mesh.dissector(tvb, pinfo, root)
  if tvb:len() < PAYLOAD_BYTES then
    return 0
  end
  local kind = tvb(2, 1):uint()
  local name = types[kind] or (kind >= 128 and "users' data" or "type " .. kind)
  pinfo.cols.protocol = "DRONE_MESH"
  pinfo.cols.src = tostring(tvb(1, 1):uint())
  pinfo.cols.dst = tvb(3, 1):uint() == 254 and "all" or tostring(tvb(3, 1):uint())
  pinfo.cols.info = string.format(
    "%s made by %d, for %d", name, tvb(0, 1):uint(), tvb(4, 1):uint()
  )
  local tree = root:add(mesh, tvb(0, PAYLOAD_BYTES), "Drone mesh, " .. name)
  for index, field in ipairs({ f.creator, f.from, f.type, f.to, f.forward }) do
    tree:add(field, tvb(index - 1, 1))
  end
  local at = HEADER_BYTES
  for _, entry in ipairs(bodies[kind] or {}) do
    for _, field in ipairs(fields_of(kind, entry[1])) do
      tree:add_le(field, tvb(at, entry[3]))
    end
    at = at + entry[3]
  end
  if kind == BEACON then
    at = add_beacon_parts(tree, tvb, at)
  end
  tree:add(kind >= 128 and f.data or f.rest, tvb(at, PAYLOAD_BYTES - at))
  return PAYLOAD_BYTES
end

local nrf24 = Proto("nrf24", "nRF24L01+")
local g = {
  address = ProtoField.bytes("nrf24.address", "Address"),
  length = ProtoField.uint16("nrf24.length", "Length field", base.DEC, nil, 0xfc00),
  pid = ProtoField.uint16("nrf24.pid", "PID", base.DEC, nil, 0x0300),
  no_ack = ProtoField.bool("nrf24.no_ack", "No acknowledgement wanted", 16, nil, 0x0080),
}
nrf24.fields = g

local ADDRESS_AT, CONTROL_AT = 1, 6
-- By the bytes of the frame: whether it has a packet control field, and a payload.
local shapes = {
  [42] = { true, true }, [41] = { true, true }, -- CRC of 16 and 8 bits
  [40] = { false, true }, [39] = { false, true }, -- plain ShockBurst
  [10] = { true, false }, [9] = { true, false }, -- acknowledgements
}

-- The payload behind 9 bits of control is not on a byte boundary.
local function payload_of(tvb, enhanced)
  if not enhanced then
    return tvb(CONTROL_AT, PAYLOAD_BYTES):tvb()
  end
  local bytes = ByteArray.new()
  bytes:set_size(PAYLOAD_BYTES)
  for index = 0, PAYLOAD_BYTES - 1 do
    local pair = tvb(CONTROL_AT + 1 + index, 2):uint()
    bytes:set_index(index, math.floor(pair / 128) % 256)
  end
  return bytes:tvb("Payload")
end

function nrf24.dissector(tvb, pinfo, root)
  local shape = shapes[tvb:len()]
  if not shape then
    return 0
  end
  local enhanced, has_payload = shape[1], shape[2]
  pinfo.cols.protocol = "NRF24"
  pinfo.cols.info = has_payload and "frame" or "acknowledgement"
  local tree = root:add(nrf24, tvb(), has_payload and "nRF24L01+ frame" or "nRF24L01+ acknowledgement")
  tree:add(g.address, tvb(ADDRESS_AT, 5))
  if enhanced then
    local control = tvb(CONTROL_AT, 2)
    tree:add(g.length, control)
    tree:add(g.pid, control)
    tree:add(g.no_ack, control)
  end
  if has_payload then
    mesh.dissector(payload_of(tvb, enhanced), pinfo, root)
  end
  return tvb:len()
end

local by_link = DissectorTable.get("wtap_encap")
by_link:add(wtap.USER0, nrf24)
by_link:add(wtap.USER1, mesh)
