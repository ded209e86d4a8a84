// The part of node that the client uses.
declare const process: { argv: string[] };
